//! Random changes of one place of a generated file, in any language.

use chacha20::ChaCha8Rng as Draws;
use rand::RngExt as _;

/// A changed text.
pub(crate) struct Mutant {
    pub(crate) text: String,
    /// From 1.
    pub(crate) line: usize,
    /// The function that the line is in, without `_with`; empty where all functions must be proven.
    pub(crate) function: String,
    pub(crate) what: String,
    /// Whether nothing but the order of a sum's terms, a product's factors, or of lines that do not use each
    /// other is changed.
    pub(crate) is_order: bool,
    /// Whether the code around has the same values in floating point.
    pub(crate) is_same: bool,
}

/// The lines that say what is computed, with the function that each is in.
pub(crate) fn code_lines(text: &str) -> Vec<(usize, String)> {
    let mut found = Vec::new();
    let (mut function, mut comment) = (String::new(), false);
    for (i, line) in text.lines().enumerate() {
        let code = line.trim();
        comment |= code.starts_with("/*");
        let skipped = comment || code.starts_with("//") || code.starts_with('#') || code.starts_with('*');
        comment &= !code.contains("*/");
        if skipped {
            continue;
        }
        if let Some(name) = head(line) {
            function = name;
        }
        // Names of parameters and joints are texts.
        if code.len() > 2 && !code.starts_with('"') {
            found.push((i, function.clone()));
        }
    }
    found
}

/// The function that a line is the head of.
fn head(line: &str) -> Option<String> {
    let code = line.trim();
    let is_rust = ["pub fn ", "fn "].iter().find_map(|start| code.strip_prefix(start));
    let is_module = code.starts_with("pub mod ") || code.starts_with("mod ");
    let in_c = line.ends_with('(') && !line.starts_with(' ');
    let name = match is_rust {
        Some(rest) => rest.split(['<', '(']).next()?,
        None if in_c => line.trim_end_matches('(').rsplit([' ', '*']).next()?,
        None if is_module => return Some(String::new()),
        None => return None,
    };
    Some(name.strip_suffix("_with").unwrap_or(name).to_string())
}

/// Names, numbers and single characters.
fn tokens(line: &str) -> Vec<String> {
    let mut tokens: Vec<String> = Vec::new();
    let mut open = false;
    for c in line.chars() {
        let word = c.is_alphanumeric() || c == '_' || c == '.' && open;
        match tokens.last_mut() {
            Some(last) if open && word && (c != '.' || last.starts_with(|c: char| c.is_ascii_digit())) => {
                last.push(c)
            }
            _ => tokens.push(c.to_string()),
        }
        open = word && tokens.last().is_some_and(|t| t != ".");
    }
    tokens
}

/// Whether a token names a value: `x12`, `s2m3`, `dq1`.
fn is_value(token: &str) -> bool {
    let digits = token.trim_start_matches(|c: char| c.is_ascii_lowercase());
    let letters = &token[..token.len() - digits.len()];
    !letters.is_empty() && digits.starts_with(|c: char| c.is_ascii_digit()) && !["f", "u"].contains(&letters)
}

fn is_number(token: &str) -> bool {
    token.starts_with(|c: char| c.is_ascii_digit()) && (token.contains('.') || token.ends_with("f64"))
}

/// Whether a line uses no name that another one gives a value, or gives it one too.
fn is_apart(line: &str, other: &str) -> bool {
    let words = ["let", "const", "real", "T", "mut", "f64", "SVector"];
    let is_name = |token: &String| {
        token.starts_with(|c: char| c.is_ascii_lowercase()) && !words.contains(&token.as_str())
    };
    let before = other.split_once(" = ").map_or("", |(before, _)| before);
    // A place of a struct is its own, whatever other places are called.
    if before.contains("->") {
        return !line.contains(before.trim());
    }
    let given = tokens(before);
    !given.iter().filter(|t| is_name(t)).any(|name| tokens(line).contains(name))
}

/// A random change; none where the place has none.
pub(crate) fn mutant(lines: &[(usize, String)], text: &str, rng: &mut Draws) -> Option<Mutant> {
    let of: Vec<&str> = text.lines().collect();
    let place = rng.random_range(0..lines.len());
    let (i, function) = &lines[place];
    let line = of[*i];
    let old = tokens(line);
    let mut changed: Vec<String> = of.iter().map(ToString::to_string).collect();
    let mut is_order = false;
    let statement = line.trim().ends_with(';') && line.contains(" = ");
    let what = match rng.random_range(0..12) {
        0 if statement => {
            changed[*i] = String::new();
            "dropped line"
        }
        1 if statement => {
            let (next, _) = lines.get(place + 1)?;
            let other = of[*next];
            if *next != *i + 1 || !other.trim().ends_with(';') || !other.contains(" = ") || other == line {
                return None;
            }
            changed.swap(*i, *next);
            is_order = is_apart(line, other) && is_apart(other, line);
            "order of lines"
        }
        _ => {
            let at = rng.random_range(0..old.len());
            let mut new = old.clone();
            let kind = rng.random_range(0..4);
            let around = |k: usize| at.checked_sub(k).and_then(|b| old.get(b)).zip(old.get(at + k));
            let binary = around(1).is_some_and(|(a, b)| a == " " && b == " ");
            let what = match old[at].as_str() {
                "+" | "-" | "*" | "/" if binary && kind == 0 => {
                    let (a, b) = around(2)?;
                    if a == b || !is_value(a) || !is_value(b) {
                        return None;
                    }
                    // A longer sum or product is not that of these two.
                    let alone =
                        old.iter().filter(|t| ["+", "-", "*", "/"].contains(&t.as_str())).count() == 1;
                    is_order = ["+", "*"].contains(&old[at].as_str()) && alone;
                    new.swap(at - 2, at + 2);
                    "swapped operands"
                }
                "+" if binary => {
                    new[at] = ["-", "*"][kind % 2].to_string();
                    "operator"
                }
                "-" if binary => {
                    new[at] = "+".to_string();
                    "operator"
                }
                "*" if binary => {
                    new[at] = ["/", "+"][kind % 2].to_string();
                    "operator"
                }
                "/" if binary => {
                    new[at] = "*".to_string();
                    "operator"
                }
                "-" => {
                    new[at] = String::new();
                    "sign"
                }
                number if is_number(number) => {
                    let digits = number.trim_end_matches("f64").trim_end_matches('f');
                    let value: f64 = digits.parse().ok()?;
                    let other = match kind {
                        0 => value.next_up(),
                        1 => value + 1.0,
                        _ => value * 1.5 + 0.125,
                    };
                    new[at] = number.replace(digits, &format!("{other:?}"));
                    "constant"
                }
                index
                    if index.bytes().all(|c| c.is_ascii_digit())
                        && around(1).is_some_and(|(a, _)| a == "[") =>
                {
                    let index: usize = index.parse().ok()?;
                    new[at] = (if index > 0 && kind == 0 { index - 1 } else { index + 1 }).to_string();
                    "index"
                }
                value if is_value(value) && kind == 0 && line.contains('=') => {
                    if line.split_once('=').is_some_and(|(before, _)| before.contains(value)) {
                        return None;
                    }
                    new[at] = format!("-{value}");
                    "sign"
                }
                value if is_value(value) => {
                    let near = of[i.saturating_sub(30)..=*i].iter().flat_map(|l| tokens(l));
                    let near: Vec<String> = near.filter(|t| is_value(t) && t != value).collect();
                    if near.is_empty() {
                        return None;
                    }
                    new[at] = near[rng.random_range(0..near.len())].clone();
                    "operand"
                }
                _ => return None,
            };
            changed[*i] = new.concat();
            if changed[*i] == line {
                return None;
            }
            what
        }
    };
    let is_same = same_values(&of, &changed, *i);
    Some(Mutant {
        what: format!("{what}: {} -> {}", line.trim(), changed[*i].trim()),
        text: changed.join("\n") + "\n",
        line: i + 1,
        function: function.clone(),
        is_order,
        is_same,
    })
}

/// Whether the straight-line code around a changed line gives the same results, at random values of what it
/// reads: an evaluation of its own, that shares nothing with the checker.
fn same_values(of: &[&str], changed: &[String], at: usize) -> bool {
    let ends = |line: &str| line.trim_start().starts_with('}') || line.is_empty();
    let from = (0..at).rev().find(|k| of[*k].ends_with('{')).map_or(0, |k| k + 1);
    let Some(to) = (at..of.len()).find(|k| ends(of[*k])) else { return false };
    let changed: Vec<&str> = changed.iter().map(String::as_str).collect();
    (0..5).all(|round| {
        let values = [of, &changed].map(|text| results(&text[from..to], round));
        let [Some(a), Some(b)] = values else { return false };
        let same = |(x, y): (&f64, &f64)| (x - y).abs() <= 1e-9 * (1.0 + x.abs() + y.abs());
        !a.is_empty() && a.len() == b.len() && a.iter().zip(&b).all(same)
    })
}

/// The values of all that stands behind the lines that name values, in order.
fn results(lines: &[&str], round: u64) -> Option<Vec<f64>> {
    let mut known: Vec<(String, f64)> = Vec::new();
    let mut found = Vec::new();
    for line in lines.iter().filter(|line| !line.trim().is_empty()) {
        let (before, value) = line.split_once(" = ").unwrap_or(("result", line));
        let names = tokens(before);
        let name = names.iter().rev().find(|t| is_value(t)).cloned();
        let mut reader = Expression { tokens: simple(value), known: &known, round };
        let number = reader.sum().filter(|_| reader.tokens.is_empty());
        match (name, number) {
            (Some(name), Some(x)) if !before.contains("result") && !before.contains("values") => {
                known.push((name, x));
            }
            // Inputs are as random as their places.
            (Some(name), None) if !before.contains(['[', '(']) && value.contains(['[', '>']) => {
                known.push((name, random(value, round)));
            }
            (_, Some(x)) => {
                found.push(random(before, round));
                found.push(x);
            }
            (_, None) if line.contains(" = ") => found.push(random(line, round)),
            // What is returned: every value in it, with its sign.
            (_, None) => {
                let words = tokens(value);
                for (k, word) in words.iter().enumerate().filter(|(_, word)| is_value(word)) {
                    let sign = if k > 0 && words[k - 1] == "-" { -1.0 } else { 1.0 };
                    found.push(sign * Expression { tokens: vec![], known: &known, round }.value(word));
                }
            }
        }
    }
    Some(found)
}

/// Tokens of an expression without casts, suffixes and calls that make a number.
fn simple(value: &str) -> Vec<String> {
    let mut text = value.trim().trim_end_matches(';').replace("(real)", "");
    for call in ["nalgebra::convert::<f64, T>", "nalgebra::convert"] {
        text = text.replace(call, "");
    }
    let mut tokens: Vec<String> = tokens(&text).into_iter().filter(|t| t != " ").collect();
    tokens.reverse();
    tokens
}

/// A number between 0.5 and 1.5 that belongs to a text.
fn random(text: &str, round: u64) -> f64 {
    let step = |h: u64, b: u8| (h ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3);
    let hash = text.bytes().fold(0xcbf2_9ce4_8422_2325 ^ (round << 40), step);
    0.5 + (hash.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 11) as f64 / (1u64 << 53) as f64
}

struct Expression<'a> {
    /// The next one last.
    tokens: Vec<String>,
    known: &'a [(String, f64)],
    round: u64,
}

impl Expression<'_> {
    fn takes(&mut self, wanted: &str) -> bool {
        self.tokens.pop_if(|token| token == wanted).is_some()
    }

    fn sum(&mut self) -> Option<f64> {
        let mut sum = self.product()?;
        loop {
            if self.takes("+") {
                sum += self.product()?;
            } else if self.takes("-") {
                sum -= self.product()?;
            } else {
                return Some(sum);
            }
        }
    }

    fn product(&mut self) -> Option<f64> {
        let mut product = self.atom()?;
        loop {
            if self.takes("*") {
                product *= self.atom()?;
            } else if self.takes("/") {
                product /= self.atom()?;
            } else {
                return Some(product);
            }
        }
    }

    fn atom(&mut self) -> Option<f64> {
        let token = self.tokens.pop()?;
        match token.as_str() {
            "-" => Some(-self.atom()?),
            "(" => self.sum().filter(|_| self.takes(")")),
            "fused" | "fma" if self.takes("(") => {
                let x = self.sum().filter(|_| self.takes(","))?;
                let y = self.sum().filter(|_| self.takes(","))?;
                let z = self.sum().filter(|_| self.takes(")"))?;
                Some(x * y + z)
            }
            number if is_number(number) => number.trim_end_matches("f64").trim_end_matches('f').parse().ok(),
            name if is_value(name)
                && self.tokens.last().is_none_or(|next| !["[", "(", "."].contains(&next.as_str())) =>
            {
                Some(self.value(name))
            }
            _ => None,
        }
    }

    /// A value that was named; sines and cosines are those of random angles, others random.
    fn value(&self, name: &str) -> f64 {
        if let Some((_, x)) = self.known.iter().rev().find(|(known, _)| known == name) {
            return *x;
        }
        let (letter, sum) = name.split_at(1);
        let angle = || {
            let mut angle = 0.0;
            let mut sign = 1.0;
            for joint in sum.split_inclusive(['p', 'm']) {
                angle += sign * random(joint.trim_end_matches(['p', 'm']), self.round);
                sign = if joint.ends_with('m') { -1.0 } else { 1.0 };
            }
            angle
        };
        match letter {
            "s" => angle().sin(),
            "c" => angle().cos(),
            _ => random(name, self.round),
        }
    }
}
