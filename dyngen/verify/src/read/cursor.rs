//! A text as tokens, read one after the other, and what the languages share that write expressions as C does.

use super::head::Literals;
use crate::language::{Expr, Kind, Let, Pattern};
use crate::{Checked, wrong};

/// Where such languages differ.
pub(crate) struct Dialect {
    /// What begins and ends a comment.
    pub(crate) comment: (&'static str, &'static str),
    /// What stands between a struct and its field.
    pub(crate) field: &'static str,
    /// What stands before a number, and at its end.
    pub(crate) number: (&'static str, &'static str),
}

/// Words, numbers, strings, lines of the preprocessor and single characters (`->` and `//` are one), each
/// with its line.
fn tokens(text: &str, dialect: &Dialect) -> Vec<(usize, String)> {
    let (opens, closes) = dialect.comment;
    let (mut found, mut rest, mut line) = (Vec::new(), text, 1);
    while let Some(first) = rest.chars().next() {
        let until =
            |end: &str, from: usize| rest[from..].find(end).map_or(rest.len(), |k| k + from + end.len());
        let word = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '.' && first.is_ascii_digit();
        let length = match first {
            _ if rest.starts_with(opens) => until(closes, opens.len()),
            '#' => until("\n", 0),
            '"' => {
                let mut escaped = false;
                let end = rest[1..].find(|c| {
                    let ends = c == '"' && !escaped;
                    escaped = c == '\\' && !escaped;
                    ends
                });
                end.map_or(rest.len(), |k| k + 2)
            }
            _ if word(first) => {
                // A number's exponent may have a sign.
                let exponent =
                    |k: usize| first.is_ascii_digit() && !rest.starts_with("0x") && rest[..k].ends_with('e');
                let ends = |(k, c): (usize, char)| !(word(c) || c == '-' && exponent(k));
                rest.char_indices().position(ends).unwrap_or(rest.len())
            }
            // In C89 no comment: what C99 leaves out behind it would be code.
            _ if rest.starts_with("->") || rest.starts_with("//") => 2,
            other => other.len_utf8(),
        };
        let (token, after) = rest.split_at(length);
        if !first.is_whitespace() && !token.starts_with(opens) {
            found.push((line, token.trim_end().to_string()));
        }
        line += token.matches('\n').count();
        rest = after;
    }
    found
}

/// Where a text is read.
pub(crate) struct Cursor<'a> {
    dialect: &'a Dialect,
    literals: &'a Literals,
    tokens: std::iter::Peekable<std::vec::IntoIter<(usize, String)>>,
    last: usize,
    /// Where literals stand: the function, then a space and the name of a value.
    pub(crate) place: String,
    /// The function that gives x·y + z; empty where the file has none.
    pub(crate) fused: &'static str,
    /// The function that gives a square root; empty where the file has none.
    pub(crate) root: &'static str,
    /// Literals of many digits that the head does not explain, with their lines.
    pub(crate) unexplained: Vec<(usize, String)>,
}

impl<'a> Cursor<'a> {
    pub(crate) fn new(text: &str, dialect: &'a Dialect, literals: &'a Literals) -> Cursor<'a> {
        let all = tokens(text, dialect);
        Cursor {
            dialect,
            literals,
            last: all.last().map_or(1, |token| token.0),
            tokens: all.into_iter().peekable(),
            place: String::new(),
            fused: "",
            root: "",
            unexplained: Vec::new(),
        }
    }

    pub(crate) fn peek(&mut self) -> Option<&str> {
        self.tokens.peek().map(|token| token.1.as_str())
    }

    pub(crate) fn line(&mut self) -> usize {
        self.tokens.peek().map_or(self.last, |token| token.0)
    }

    pub(crate) fn next(&mut self) -> String {
        self.tokens.next().map_or(String::new(), |token| token.1)
    }

    pub(crate) fn takes(&mut self, wanted: &str) -> bool {
        self.peek() == Some(wanted) && self.tokens.next().is_some()
    }

    /// The next tokens must be these, separated by spaces.
    pub(crate) fn expect(&mut self, wanted: &str) -> Checked<()> {
        for token in wanted.split(' ') {
            let line = self.line();
            if !self.takes(token) {
                return wrong(line, &format!("'{token}' is expected here"));
            }
        }
        Ok(())
    }

    /// A text must stand here; `instead` says what is wrong where it does not.
    pub(crate) fn text(&mut self, wanted: &str, instead: &str) -> Checked<()> {
        for (_, token) in tokens(wanted, self.dialect) {
            let line = self.line();
            if !self.takes(&token) {
                return wrong(line, instead);
            }
        }
        Ok(())
    }

    /// The tokens before one that begins with any of some characters.
    pub(crate) fn until(&mut self, ends: &str) -> Vec<String> {
        let mut words = Vec::new();
        while self.peek().is_some_and(|token| !token.starts_with(|c| ends.contains(c))) {
            words.push(self.next());
        }
        words
    }

    /// `[k]`
    pub(crate) fn index(&mut self) -> Checked<usize> {
        self.expect("[")?;
        let line = self.line();
        let Ok(index) = self.next().parse() else { return wrong(line, "a number is expected here") };
        self.expect("]")?;
        Ok(index)
    }

    /// `NAME = …;`, a sum.
    pub(crate) fn named(&mut self) -> Checked<Let> {
        self.named_by(Self::sum)
    }

    /// `NAME = …;`
    pub(crate) fn named_by(&mut self, value: impl FnOnce(&mut Self) -> Checked<Expr>) -> Checked<Let> {
        let name = self.next();
        let outside = std::mem::take(&mut self.place);
        self.place = format!("{outside} {name}");
        self.expect("=")?;
        let value = value(self)?;
        self.place = outside;
        self.expect(";")?;
        Ok(Let { pattern: Pattern::Name(name), value })
    }

    pub(crate) fn sum(&mut self) -> Checked<Expr> {
        self.operations(&["+", "-"])
    }

    fn operations(&mut self, of: &[&str]) -> Checked<Expr> {
        let line = self.line();
        let mut value = self.operand(of)?;
        while let Some(operation) =
            self.peek().filter(|token| of.contains(token)).and_then(|t| t.chars().next())
        {
            self.next();
            let other = self.operand(of)?;
            value = Expr { line, kind: Kind::Binary(operation, Box::new(value), Box::new(other)) };
        }
        Ok(value)
    }

    fn operand(&mut self, of: &[&str]) -> Checked<Expr> {
        if of == ["+", "-"] { self.operations(&["*", "/"]) } else { self.atom() }
    }

    fn atom(&mut self) -> Checked<Expr> {
        let line = self.line();
        let (cast, suffix) = self.dialect.number;
        let kind = match self.next().as_str() {
            "-" => Kind::Negative(Box::new(self.atom()?)),
            "(" if !cast.is_empty() && self.takes(cast) => {
                self.expect(")")?;
                let negative = self.takes("-");
                let digits = self.next();
                // `010` is eight.
                if !digits.contains(['.', 'e']) {
                    return wrong(line, &format!("{digits} is no number that dyngen writes"));
                }
                let number = Expr { line, kind: self.literal(line, &digits)? };
                if negative { Kind::Negative(Box::new(number)) } else { return Ok(number) }
            }
            "(" => {
                let value = self.sum()?;
                self.expect(")")?;
                return Ok(value);
            }
            number if cast.is_empty() && number.starts_with(|c: char| c.is_ascii_digit()) => {
                let Some(digits) = number.strip_suffix(suffix) else {
                    return wrong(line, &format!("a number that does not end in {suffix}"));
                };
                self.literal(line, digits)?
            }
            name @ ("sign" | "tangent") if self.takes("(") => {
                let name = if name == "sign" { "sign" } else { "tanh" };
                let of = Box::new(self.sum()?);
                self.expect(")")?;
                Kind::Free(name, of)
            }
            name if name == self.root && self.takes("(") => {
                let of = Box::new(self.sum()?);
                self.expect(")")?;
                Kind::Root(of)
            }
            name if name == self.fused && self.takes("(") => return self.product_and_sum(line),
            word if word.starts_with(|c: char| c.is_ascii_lowercase()) => {
                let name = Expr { line, kind: Kind::Name(word.to_string()) };
                if self.takes(self.dialect.field) {
                    let field = self.next();
                    let list = match field.as_str() {
                        // Of a sine with its cosine.
                        "x" => return Ok(Expr { line, kind: Kind::Index(Box::new(name), 0) }),
                        "y" => return Ok(Expr { line, kind: Kind::Index(Box::new(name), 1) }),
                        "values" => name,
                        _ => Expr { line, kind: Kind::Field(Box::new(name), field) },
                    };
                    Kind::Index(Box::new(list), self.index()?)
                } else if self.peek() == Some("[") {
                    // A vector is the one column of a matrix.
                    let row = self.index()?;
                    let column = if self.peek() == Some("[") { self.index()? } else { 0 };
                    let column = Expr { line, kind: Kind::Index(Box::new(name), column) };
                    Kind::Index(Box::new(column), row)
                } else {
                    return Ok(name);
                }
            }
            _ => return wrong(line, "an expression that dyngen does not write"),
        };
        Ok(Expr { line, kind })
    }

    /// `x, y, z)`: x·y + z.
    fn product_and_sum(&mut self, line: usize) -> Checked<Expr> {
        let x = self.sum()?;
        self.expect(",")?;
        let y = self.sum()?;
        self.expect(",")?;
        let z = self.sum()?;
        self.expect(")")?;
        Ok(Expr::fused(line, [x, y, z]))
    }

    fn literal(&mut self, line: usize, digits: &str) -> Checked<Kind> {
        if self.literals.is_unexplained(digits) {
            self.unexplained.push((line, digits.to_string()));
        }
        match self.literals.exact(digits, &self.place) {
            Some(exact) => Ok(Kind::Number(exact)),
            None => wrong(line, &format!("{digits} is no number that dyngen writes")),
        }
    }
}
