//! Reads a generated file in WGSL: whatever it does not know is an error.

use super::cursor::{Cursor, Dialect};
use super::head::Literals;
use super::kernel::{Kernel, size};
use crate::language::{Expr, Kind, Let, Routine};
use crate::{Checked, Source, wrong};
use dyngen_arm::Function;
use dyngen_arm::function::Argument;

/// Numbers have a suffix: `0.5f`.
const DIALECT: Dialect = Dialect { comment: ("//", "\n"), field: ".", number: ("", "f") };

/// Sines and cosines, tested where they are written.
const TRIGONOMETRY: &str = crate::text::TRIGONOMETRY_WGSL;

/// The fields of the struct of sines and cosines, with the constants that are their lengths.
const TRIG: [(&str, &str); 3] = [("sin", "ANGLES"), ("cos", "ANGLES"), ("position", "JOINTS")];

/// What ends a comment in WGSL and is no end of a line elsewhere: what stands behind it would be code.
const LINE_BREAKS: [char; 6] = ['\u{b}', '\u{c}', '\r', '\u{85}', '\u{2028}', '\u{2029}'];

/// Reads a file; `frames` are those of the arm.
pub(crate) fn read(text: &str, literals: &Literals, frames: &[String]) -> Checked<Source> {
    let broken = text.lines().position(|line| line.contains(LINE_BREAKS));
    // `lines` takes "\r\n" for one end of a line.
    if let Some(line) = broken.or_else(|| text.find('\r').map(|_| 0)) {
        return wrong(line + 1, "a line break that dyngen does not write");
    }
    let mut reader = Reader {
        text: Cursor::new(text, &DIALECT, literals),
        frames,
        prefix: String::new(),
        values: 0,
        source: Source::default(),
    };
    reader.text.fused = "fma";
    reader.text.root = "sqrt";
    for list in ["joint_names", "parameter_names"] {
        reader.listed(text, list);
    }
    while reader.text.peek().is_some() {
        reader.item()?;
    }
    Ok(Source { unexplained: reader.text.unexplained, ..reader.source })
}

/// An argument by its name.
fn argument(name: &str) -> Option<Argument> {
    Function::ALL.iter().flat_map(|f| f.arguments()).copied().find(|a| a.name() == name)
}

struct Reader<'a> {
    text: Cursor<'a>,
    frames: &'a [String],
    /// `name_` of the arm.
    prefix: String,
    /// How many values are prepared.
    values: usize,
    source: Source,
}

impl Reader<'_> {
    /// Names, which stand in comments, since the language has no text.
    fn listed(&mut self, text: &str, list: &str) {
        let entry = |(i, line): (usize, &str)| {
            let (index, name) =
                line.strip_prefix("// ")?.strip_prefix(list)?.strip_prefix('[')?.split_once("]: ")?;
            Some((i + 1, index.parse::<usize>().ok()?, name.to_string()))
        };
        let found: Vec<_> = text.lines().enumerate().filter_map(entry).collect();
        // Names out of order are none.
        if let Some((line, ..)) = found.first()
            && found.iter().enumerate().all(|(k, (_, index, _))| k == *index)
        {
            let names = found.iter().map(|(.., name)| name.clone()).collect();
            self.source.constants.insert(list.to_uppercase(), (*line, names));
        }
    }

    fn item(&mut self) -> Checked<()> {
        let line = self.text.line();
        match self.text.next().as_str() {
            "const" => self.constant(line),
            "struct" => self.record(line),
            "fn" if self.text.peek() == Some("sine_series") => {
                let (_, behind) = TRIGONOMETRY.split_once("fn ").unwrap_or_default();
                self.text.text(behind, "sines and cosines that are not those of this version of dyngen")
            }
            "fn" => self.function(line),
            "@" if self.text.peek() == Some("compute") => self.entry_point(line),
            "@" => self.binding(line),
            _ => wrong(line, "an item that dyngen does not write"),
        }
    }

    /// A name of the arm's, without what it begins with.
    fn own_name(&mut self) -> Checked<String> {
        let line = self.text.line();
        let name = self.text.next();
        match name.strip_prefix(&self.prefix) {
            Some(name) if !self.prefix.is_empty() => Ok(name.to_string()),
            _ => wrong(line, "a name that does not begin with the arm's"),
        }
    }

    /// `const NAME_JOINTS: u32 = 6u;`, of which the first says how names begin, or the values that are baked
    /// in.
    fn constant(&mut self, line: usize) -> Checked<()> {
        let name = self.text.next();
        let upper = name.strip_suffix("_JOINTS").filter(|_| self.prefix.is_empty());
        if let Some(upper) = upper {
            self.prefix = format!("{}_", upper.to_lowercase());
        }
        let (name, entries) = if name == format!("{}parameter_values", self.prefix) {
            self.text.expect("=")?;
            ("PARAMETER_VALUES", self.values()?)
        } else {
            let name = name.strip_prefix(&self.prefix.to_uppercase()).unwrap_or_default();
            let Some(name) = ["JOINTS", "PARAMETERS", "ANGLES"].into_iter().find(|known| *known == name)
            else {
                return wrong(line, "a constant that dyngen does not write");
            };
            self.text.expect(": u32 =")?;
            let number = self.text.next();
            let Some(digits) = number.strip_suffix('u') else {
                return wrong(line, "a number is expected here");
            };
            (name, vec![digits.to_string()])
        };
        self.text.expect(";")?;
        match self.source.constants.insert(name.to_string(), (line, entries)) {
            None => Ok(()),
            Some(_) => wrong(line, "a second constant of this name"),
        }
    }

    /// The digits of an array's numbers.
    fn values(&mut self) -> Checked<Vec<String>> {
        let line = self.text.line();
        self.array_type(size(&self.source, line, "PARAMETERS")?)?;
        self.text.expect("(")?;
        let mut entries = Vec::new();
        while self.text.peek().is_some_and(|token| token != ")") {
            let sign = if self.text.takes("-") { "-" } else { "" };
            let number = self.text.next();
            entries.push(format!("{sign}{}", number.strip_suffix('f').unwrap_or_default()));
            self.text.expect(",")?;
        }
        self.text.expect(")")?;
        Ok(entries)
    }

    /// `array<f32, 6>`
    fn array_type(&mut self, length: usize) -> Checked<()> {
        self.text.expect(&format!("array < f32 , {length} >"))
    }

    /// One of the two structs.
    fn record(&mut self, line: usize) -> Checked<()> {
        let name = self.own_name()?;
        self.text.expect("{")?;
        match name.as_str() {
            "trig" => {
                for (field, length) in TRIG {
                    self.text.expect(&format!("{field} :"))?;
                    self.array_type(size(&self.source, line, length)?)?;
                    self.text.expect(",")?;
                }
            }
            "prepared" => {
                self.text.expect("values : array < f32 ,")?;
                let line = self.text.line();
                let Ok(length) = self.text.next().parse() else {
                    return wrong(line, "a length is expected here");
                };
                self.values = length;
                self.text.expect("> ,")?;
            }
            _ => return wrong(line, "a struct that dyngen does not write"),
        }
        self.text.expect("}")
    }

    /// A variable that is bound to a buffer, at the place that is its argument's in every file.
    fn binding(&mut self, line: usize) -> Checked<()> {
        self.text.expect("group ( 0 ) @ binding (")?;
        let place = self.text.next();
        self.text.expect(") var <")?;
        let access = self.text.until(">").join(" ");
        self.text.expect(">")?;
        let name = self.own_name()?;
        let right = match (name.as_str(), argument(&name)) {
            ("count", _) => 0,
            (_, Some(argument)) => argument as usize + 1,
            // The result, behind all arguments.
            _ => Argument::Parameters as usize + 2,
        };
        if place != right.to_string() {
            return wrong(line, "a buffer at another place than dyngen gives it");
        }
        match (access.as_str(), name.as_str()) {
            ("uniform", "count") => self.text.expect(": u32 ;"),
            ("storage , read_write", "result") => self.text.expect(": array < f32 > ;"),
            ("storage , read", "parameters") => {
                self.text.expect(":")?;
                self.array_type(size(&self.source, line, "PARAMETERS")?)?;
                self.text.expect(";")
            }
            ("storage , read", name) if argument(name).is_some() => self.text.expect(": array < f32 > ;"),
            _ => wrong(line, "a variable that dyngen does not write"),
        }
    }

    fn function(&mut self, line: usize) -> Checked<()> {
        let name = self.own_name()?;
        let Some(name) = crate::routine(&name, self.frames) else {
            return wrong(line, &format!("dyngen writes no function {name}"));
        };
        let parameters = self.parameters()?;
        self.text.expect("->")?;
        let shape = self.result_type(&name)?;
        self.text.place = name.clone();
        self.text.expect("{")?;
        let mut lets = Vec::new();
        while self.text.takes("let") {
            lets.push(self.statement()?);
        }
        let end = self.text.line();
        self.text.expect("return")?;
        let result = self.result(end, &name, shape)?;
        self.text.expect("; }")?;
        let body = Expr { line: end, kind: Kind::Block(lets, Box::new(result)) };
        match self.source.routines.insert(name, Routine { line, parameters, body }) {
            None => Ok(()),
            Some(_) => wrong(line, "a second function of this name"),
        }
    }

    /// The names of what a function reads.
    fn parameters(&mut self) -> Checked<Vec<String>> {
        let mut read = Vec::new();
        self.text.expect("(")?;
        loop {
            let line = self.text.line();
            let name = self.text.next();
            self.text.expect(":")?;
            match (name.as_str(), argument(&name)) {
                ("trig" | "prepared", _) => self.text.expect(&format!("{}{name}", self.prefix))?,
                (_, Some(argument)) => {
                    let [n, p] = ["JOINTS", "PARAMETERS"].map(|of| size(&self.source, line, of));
                    self.array_type(argument.length(n?, p?))?;
                }
                _ => return wrong(line, "a parameter that dyngen does not write"),
            }
            read.push(name);
            if !self.text.takes(",") {
                break;
            }
        }
        self.text.expect(")")?;
        Ok(read)
    }

    /// The type of a function's result; gives its rows and columns, none where it is a struct.
    fn result_type(&mut self, name: &str) -> Checked<Option<(usize, usize)>> {
        let line = self.text.line();
        let of = name.rsplit("::").next().unwrap_or(name);
        let Some(function) = Function::parse(of.strip_suffix("_with").unwrap_or(of)) else {
            let name = if name == "prepare" { "prepared" } else { "trig" };
            return self.text.expect(&format!("{}{name}", self.prefix)).map(|()| None);
        };
        if matches!(function, Function::KineticEnergy | Function::PotentialEnergy) {
            return self.text.expect("f32").map(|()| Some((1, 1)));
        }
        let [n, p] = ["JOINTS", "PARAMETERS"].map(|of| size(&self.source, line, of));
        let (rows, columns) = function.shape(n?, p?);
        self.array_type(rows * columns).map(|()| Some((rows, columns)))
    }

    /// What stands behind `let`.
    fn statement(&mut self) -> Checked<Let> {
        self.text.named_by(|text| {
            let line = text.line();
            if !text.takes("sin_cos") {
                return text.sum();
            }
            text.expect("(")?;
            let angle = text.sum()?;
            text.expect(")")?;
            Ok(Expr { line, kind: Kind::SinCos(Box::new(angle)) })
        })
    }

    /// What a function returns, of `shape` where it is no struct.
    fn result(&mut self, line: usize, name: &str, shape: Option<(usize, usize)>) -> Checked<Expr> {
        match shape {
            Some(_) if !name.ends_with("_with") => self.call(line, name),
            Some((rows, columns)) if self.text.peek() == Some("array") => {
                let mut lists = vec![Vec::new(); columns];
                for (k, entry) in self.entries(rows * columns)?.into_iter().enumerate() {
                    lists[k % columns].push(entry);
                }
                let list = |entries: Vec<Expr>| Expr { line, kind: Kind::List(entries) };
                Ok(list(lists.into_iter().map(list).collect()))
            }
            Some(_) => self.text.sum(),
            None if name == "prepare" => {
                self.text.expect(&format!("{}prepared (", self.prefix))?;
                let list = Expr { line, kind: Kind::List(self.entries(self.values)?) };
                self.text.expect(")")?;
                Ok(Expr { line, kind: Kind::AsPrepared(Box::new(list)) })
            }
            None => {
                self.text.expect(&format!("{}trig (", self.prefix))?;
                let mut fields = Vec::new();
                for (field, length) in TRIG {
                    let entries = self.entries(size(&self.source, line, length)?)?;
                    self.text.expect(",")?;
                    fields.push((field.to_string(), Expr { line, kind: Kind::List(entries) }));
                }
                self.text.expect(")")?;
                Ok(Expr { line, kind: Kind::Record(fields) })
            }
        }
    }

    /// `array<f32, 2>(x1, -x2,)`
    fn entries(&mut self, count: usize) -> Checked<Vec<Expr>> {
        self.array_type(count)?;
        self.text.expect("(")?;
        let mut entries = Vec::new();
        for _ in 0..count {
            entries.push(self.text.sum()?);
            self.text.expect(",")?;
        }
        self.text.expect(")")?;
        Ok(entries)
    }

    /// `NAME_gravity_with(NAME_trig_of(q), NAME_prepare(parameters))`
    fn call(&mut self, line: usize, name: &str) -> Checked<Expr> {
        let wanted = format!("{}{}_with", self.prefix, name.replace("::", "_"));
        self.text.expect(&format!("{wanted} ( {}trig_of ( q )", self.prefix))?;
        let word = |name: &str| Expr { line, kind: Kind::Name(name.to_string()) };
        let mut arguments = vec![Expr { line, kind: Kind::Call("Trig::new".to_string(), vec![word("q")]) }];
        while self.text.takes(",") {
            let name = self.text.next();
            if name == format!("{}prepare", self.prefix) {
                self.text.expect("( parameters )")?;
                arguments.push(Expr { line, kind: Kind::Prepared(Box::new(word("parameters"))) });
            } else {
                arguments.push(word(&name));
            }
        }
        self.text.expect(")")?;
        Ok(Expr { line, kind: Kind::Call(format!("{name}_with"), arguments) })
    }

    /// An entry point, which must be what its function says.
    fn entry_point(&mut self, line: usize) -> Checked<()> {
        self.text.expect("compute @ workgroup_size ( 64 ) fn")?;
        let name = self.own_name()?;
        let called =
            name.strip_suffix("_batch").and_then(|name| Some((name, crate::routine(name, self.frames)?)));
        let function = called.as_ref().and_then(|(_, routine)| Function::parse(routine.rsplit("::").next()?));
        let (Some((called, routine)), Some(function)) = (called, function) else {
            return wrong(line, &format!("dyngen writes no entry point {name}"));
        };
        let in_file = format!("{}{called}", self.prefix);
        let kernel = Kernel::new(&self.source, line, &in_file, &self.prefix, function)?;
        self.text.text(&kernel.in_wgsl(), "an entry point that is not what its function says")?;
        self.source.kernels.push(format!("{routine}_batch"));
        Ok(())
    }
}
