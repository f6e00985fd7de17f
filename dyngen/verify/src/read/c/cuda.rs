//! What a file in CUDA has more than one in C: sizes and types in place of a header, and kernels.

use super::super::kernel::Kernel;
use super::{OTHER, Reader, TRIGONOMETRY};
use crate::text::BEFORE_CUDA;
use crate::{Checked, wrong};
use dyngen_arm::Function;

/// The type of the numbers, with the arm's name for NAME and name.
const NUMBERS: &str = "
#ifdef NAME_FLOAT
typedef float name_real;
#else
typedef double name_real;
#endif
typedef name_real real;
";

impl Reader<'_> {
    pub(crate) fn before_cuda(&mut self) -> Checked<()> {
        self.text.text(BEFORE_CUDA, OTHER)?;
        let line = self.text.line();
        let upper = self.text.peek().and_then(|line| line.strip_prefix("#ifdef ")?.strip_suffix("_FLOAT"));
        let Some(upper) = upper.map(str::to_string) else { return wrong(line, OTHER) };
        let lower = upper.to_lowercase();
        self.prefix = format!("{lower}_");
        self.text.text(&NUMBERS.replace("NAME", &upper).replace("name", &lower), OTHER)?;
        self.fused()?;
        self.root()?;
        // An arm whose joints all slide has no sines.
        if self.text.peek().is_some_and(|token| token == format!("#ifdef {upper}_FLOAT")) {
            let device = TRIGONOMETRY.replace("\nstatic ", "\nstatic __device__ ");
            self.text.text(&device.replace("NAME", &upper), OTHER)?;
        }
        Ok(())
    }

    /// The words before the name of an item as they are in C; none where it is one that C has not, which is
    /// read.
    pub(crate) fn of_cuda(&mut self, line: usize, kind: &str, name: &str) -> Checked<Option<String>> {
        if self.text.peek().is_some_and(|token| token.starts_with('#')) && kind.is_empty() && name.is_empty()
        {
            return self.size(line).map(|()| None);
        }
        match (kind, name) {
            ("extern \"C\" __global__ void", _) => self.kernel(line, name).map(|()| None),
            ("typedef", "struct") => self.record(line).map(|()| None),
            ("static __device__ real", _) => Ok(Some("static real".to_string())),
            (kind, _) => {
                let constant = kind.strip_prefix("inline ").filter(|kind| kind.starts_with("const "));
                match constant.or(kind.strip_prefix("inline __device__ ")) {
                    Some(kind) => Ok(Some(kind.to_string())),
                    None => wrong(line, "an item that dyngen does not write"),
                }
            }
        }
    }

    /// `#define NAME_JOINTS 6`
    fn size(&mut self, line: usize) -> Checked<()> {
        let text = self.text.next();
        let words: Vec<&str> = text.split(' ').collect();
        let upper = self.upper();
        let (name, number) = match words[..] {
            ["#define", name, number] if number.bytes().all(|c| c.is_ascii_digit()) => (name, number),
            _ => return wrong(line, "a line of the preprocessor that dyngen does not write"),
        };
        let name = name.strip_prefix(&upper).and_then(|name| name.strip_prefix('_')).unwrap_or_default();
        match name {
            "JOINTS" | "PARAMETERS" | "ANGLES" | "FRICTION_TERMS" => {}
            _ => return wrong(line, "a macro that dyngen does not write"),
        }
        match self.source.constants.insert(name.to_string(), (line, vec![number.to_string()])) {
            None => Ok(()),
            Some(_) => wrong(line, "a second macro of this name"),
        }
    }

    /// One of the two structs.
    fn record(&mut self, line: usize) -> Checked<()> {
        self.text.expect("{")?;
        let (prefix, upper) = (self.prefix.clone(), self.upper());
        let fields = self.text.until("}").join(" ");
        let wanted = |fields: &[(&str, &str)]| {
            let field = |(name, length): &(&str, &str)| format!("{prefix}real {name} [ {length} ] ;");
            fields.iter().map(field).collect::<Vec<_>>().join(" ")
        };
        let [angles, joints] = ["ANGLES", "JOINTS"].map(|size| format!("{upper}_{size}"));
        if fields == wanted(&[("sin", &angles), ("cos", &angles), ("position", &joints)]) {
            return self.text.expect(&format!("}} {prefix}trig ;"));
        }
        let length = fields.split(' ').nth(3).and_then(|length| length.parse::<usize>().ok());
        match length {
            Some(length) if fields == wanted(&[("values", &length.to_string())]) => {
                self.values = Some(length);
                self.text.expect(&format!("}} {prefix}prepared ;"))
            }
            _ => wrong(line, "a struct that dyngen does not write"),
        }
    }

    /// A kernel, which must be what its function says.
    fn kernel(&mut self, line: usize, name: &str) -> Checked<()> {
        let called = name.strip_suffix("_batch").and_then(|name| Some((name, self.routine(name)?)));
        let function = called.as_ref().and_then(|(_, routine)| Function::parse(routine.rsplit("::").next()?));
        let (Some((called, routine)), Some(function)) = (called, function) else {
            return wrong(line, &format!("dyngen writes no kernel {name}"));
        };
        let (prefix, file_name) = (self.prefix.clone(), format!("{}{called}", self.prefix));
        let kernel = Kernel::new(&self.source, line, &file_name, &prefix, function)?;
        self.text.text(&kernel.in_cuda(), "a kernel that is not what its function says")?;
        self.source.kernels.push(format!("{routine}_batch"));
        Ok(())
    }
}
