//! What kernels in CUDA and entry points in WGSL must be: the text of each, from its function alone.

use crate::{Checked, Source, wrong};
use dyngen_arm::Function;
use dyngen_arm::function::{Argument, Size};

/// More joints, angles or parameters than this no arm has.
pub(super) const MOST: usize = 1000;

/// A number of joints, parameters or angles, which a file must say before it is used.
pub(crate) fn size(source: &Source, line: usize, name: &str) -> Checked<usize> {
    let number = source.constants.get(name).and_then(|(_, entries)| entries.first()?.parse().ok());
    match number.filter(|n: &usize| *n <= MOST) {
        Some(number) => Ok(number),
        None => wrong(line, &format!("{name} must be said before")),
    }
}

/// A function that is called for many states.
pub(crate) struct Kernel<'a> {
    /// In the file.
    name: &'a str,
    /// `name_` of the arm.
    prefix: &'a str,
    /// What it takes, with the length; none where it is the same for all states.
    arguments: Vec<(&'static str, Option<usize>)>,
    rows: usize,
    columns: usize,
    /// Whether the result in C is an array of rows.
    has_rows: bool,
    is_number: bool,
}

impl<'a> Kernel<'a> {
    /// For a function of a file, whose constants were read before.
    pub(crate) fn new(
        source: &Source,
        line: usize,
        name: &'a str,
        prefix: &'a str,
        function: Function,
    ) -> Checked<Kernel<'a>> {
        let [n, p] = ["JOINTS", "PARAMETERS"].map(|name| size(source, line, name));
        let (n, p) = (n?, p?);
        let is_baked = source.constants.contains_key("PARAMETER_VALUES");
        let taken = function.arguments().iter().filter(|a| !(is_baked && **a == Argument::Parameters));
        let length = |a: &Argument| (*a != Argument::Parameters).then(|| a.length(n, p));
        let (rows, columns) = function.shape(n, p);
        Ok(Kernel {
            name,
            prefix,
            arguments: taken.map(|a| (a.name(), length(a))).collect(),
            rows,
            columns,
            has_rows: function.size().0 != Size::Fixed(1) && function.size().1 != Size::Fixed(1),
            is_number: matches!(function, Function::KineticEnergy | Function::PotentialEnergy),
        })
    }

    /// What stands behind the name.
    pub(crate) fn in_cuda(&self) -> String {
        let Kernel { name, prefix, .. } = self;
        let mut text = "(size_t count,".to_string();
        for (argument, _) in &self.arguments {
            text += &format!("const {prefix}real *{argument},");
        }
        text += &format!(
            "{prefix}real *result) {{ const size_t state = (size_t)blockIdx.x * blockDim.x + threadIdx.x;
             if (state < count) {{"
        );
        let mut passed = Vec::new();
        for (argument, length) in &self.arguments {
            let Some(length) = length else {
                passed.push((*argument).to_string());
                continue;
            };
            text += &format!("const real {argument}_of[{length}] = {{");
            (0..*length).for_each(|k| text += &format!("{argument}[{k} * count + state],"));
            text += "};";
            passed.push(format!("{argument}_of"));
        }
        let passed = passed.join(", ");
        if self.is_number {
            return text + &format!("result[state] = {name}({passed}); }} }}");
        }
        let Kernel { rows, columns, has_rows, .. } = *self;
        text += &match has_rows {
            true => format!("real result_of[{rows}][{columns}];"),
            false => format!("real result_of[{}];", rows * columns),
        };
        text += &format!("{name}({passed}, result_of);");
        for row in 0..rows {
            for column in 0..columns {
                let k = row * columns + column;
                let at = if has_rows { format!("[{row}][{column}]") } else { format!("[{k}]") };
                text += &format!("result[{k} * count + state] = result_of{at};");
            }
        }
        text + "} }"
    }

    /// What stands behind the name.
    pub(crate) fn in_wgsl(&self) -> String {
        let Kernel { name, prefix, .. } = self;
        let mut text = format!(
            "(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,) {{
             let count = {prefix}count;
             let state = id.y * groups.x * 64u + id.x;
             if (state < count) {{ let result = {name}("
        );
        for (argument, length) in &self.arguments {
            let Some(length) = length else {
                text += &format!("{prefix}{argument},");
                continue;
            };
            text += &format!("array<f32, {length}>(");
            (0..*length).for_each(|k| text += &format!("{prefix}{argument}[{k}u * count + state],"));
            text += "),";
        }
        text += ");";
        if self.is_number {
            return text + &format!("{prefix}result[state] = result; }} }}");
        }
        (0..self.rows * self.columns)
            .for_each(|k| text += &format!("{prefix}result[{k}u * count + state] = result[{k}];"));
        text + "} }"
    }
}
