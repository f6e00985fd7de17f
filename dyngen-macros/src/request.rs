//! What a macro call asks for: an arm and what to generate of it.

use dyngen::emit::{self, Options};
use dyngen::{Arm, Diagnostics, Function, Model, SetKind, Values};
use proc_macro2::{Span, TokenStream, TokenTree};
use quote::quote;
use std::path::Path;
use syn::parse::{Parse, ParseStream, Parser};
use syn::punctuated::Punctuated;
use syn::{Error, Ident, LitBool, LitStr, Result, Token, bracketed};

/// Where the arm comes from.
enum Source {
    /// A file, relative to the crate's folder.
    File(LitStr),
    /// The text of one.
    Inline(LitStr),
}

/// One macro call.
pub(crate) struct Request {
    source: Source,
    /// A file of parameter values to bake in.
    values: Option<LitStr>,
    options: Options,
    /// What is wrong with the call itself, reported together with what is wrong with the arm.
    error: Option<Error>,
}

impl Parse for Request {
    fn parse(input: ParseStream<'_>) -> Result<Self> {
        if input.peek(LitStr) {
            let source = Source::File(input.parse()?);
            input.parse::<Option<Token![,]>>()?;
            if !input.is_empty() {
                return Err(input.error("nothing may follow the path: write `file = \"…\", parameters = …`"));
            }
            return Ok(Request { source, values: None, options: Options::default(), error: None });
        }
        let mut call = Call::default();
        while !input.is_empty() {
            let key: Ident = input.parse()?;
            input.parse::<Token![=]>()?;
            let value = value(input)?;
            call.set(&key, value);
            if !input.is_empty() {
                input.parse::<Token![,]>()?;
            }
        }
        call.finish()
    }
}

/// The tokens up to the next comma, so that a value that is wrong does not hide what follows it.
fn value(input: ParseStream<'_>) -> Result<TokenStream> {
    let mut tokens = TokenStream::new();
    while !input.is_empty() && !input.peek(Token![,]) {
        tokens.extend([input.parse::<TokenTree>()?]);
    }
    if tokens.is_empty() { Err(input.error("a value is missing")) } else { Ok(tokens) }
}

/// The keys of a call while they are read.
#[derive(Default)]
struct Call {
    seen: Vec<Ident>,
    source: Option<Source>,
    values: Option<LitStr>,
    options: Options,
    error: Option<Error>,
}

impl Call {
    fn set(&mut self, key: &Ident, value: TokenStream) {
        if self.seen.contains(key) {
            return self.wrong(Error::new(key.span(), format!("`{key}` is given twice")));
        }
        self.seen.push(key.clone());
        let read = match key.to_string().as_str() {
            "file" => syn::parse2(value).map(|text| self.source(key, Source::File(text))),
            "toml" => syn::parse2(value).map(|text| self.source(key, Source::Inline(text))),
            "values" => syn::parse2(value).map(|path| self.values = Some(path)),
            "parameters" => syn::parse2(value).and_then(|name| self.parameters(&name)),
            "functions" => names.parse2(value).map(|names| self.functions(&names)),
            "friction" => texts.parse2(value).map(|terms| self.friction(&terms)),
            "batch" => syn::parse2(value).map(|batch: LitBool| self.options.batch = batch.value),
            "tests" => syn::parse2(value).map(|tests: LitBool| self.options.tests = tests.value),
            "contract" => syn::parse2(value).map(|on: LitBool| self.options.contract = on.value),
            _ => Err(Error::new(
                key.span(),
                format!(
                    "there is no key `{key}`: there are file, toml, values, parameters, functions, friction, \
                        batch, tests, contract"
                ),
            )),
        };
        if let Err(e) = read {
            self.wrong(e);
        }
    }

    fn source(&mut self, key: &Ident, source: Source) {
        if self.source.is_some() {
            self.wrong(Error::new(key.span(), "the arm is given twice: either `file` or `toml`"));
        }
        self.source = Some(source);
    }

    fn parameters(&mut self, name: &Ident) -> Result<()> {
        let all = SetKind::ALL.map(SetKind::name).join(", ");
        self.options.parameters = SetKind::parse(&name.to_string()).ok_or_else(|| {
            Error::new(name.span(), format!("there is no parameter set `{name}`: there are {all}"))
        })?;
        Ok(())
    }

    fn functions(&mut self, names: &Punctuated<Ident, Token![,]>) {
        self.options.functions.clear();
        for name in names {
            match Function::parse(&name.to_string()) {
                Some(function) => self.options.functions.push(function),
                None => {
                    let all: Vec<&str> = Function::ALL.iter().map(|f| f.name()).collect();
                    let message = format!("there is no function `{name}`: there are {}", all.join(", "));
                    self.wrong(Error::new(name.span(), message));
                }
            }
        }
    }

    fn friction(&mut self, terms: &Punctuated<LitStr, Token![,]>) {
        for term in terms {
            match term.value().parse() {
                Ok(parsed) => self.options.friction.push(parsed),
                Err(reason) => self.wrong(Error::new(term.span(), reason)),
            }
        }
    }

    fn wrong(&mut self, e: Error) {
        match &mut self.error {
            Some(first) => first.combine(e),
            None => self.error = Some(e),
        }
    }

    fn finish(self) -> Result<Request> {
        let missing = || {
            let span = self.seen.first().map_or(Span::call_site(), Ident::span);
            Error::new(span, "no arm is given: write `file = \"…\"` or `toml = \"…\"`")
        };
        match self.source {
            Some(source) => {
                Ok(Request { source, values: self.values, options: self.options, error: self.error })
            }
            None => Err(self.error.unwrap_or_else(missing)),
        }
    }
}

/// `[regressor, gravity]`
fn names(input: ParseStream<'_>) -> Result<Punctuated<Ident, Token![,]>> {
    let content;
    bracketed!(content in input);
    Punctuated::parse_terminated(&content)
}

/// `["viscous", "tanh:216"]`
fn texts(input: ParseStream<'_>) -> Result<Punctuated<LitStr, Token![,]>> {
    let content;
    bracketed!(content in input);
    Punctuated::parse_terminated(&content)
}

impl Request {
    /// The items, or all errors of the call and of the arm.
    pub(crate) fn generate(mut self) -> Result<TokenStream> {
        let mut watched = TokenStream::new();
        let (arm, span) = match &self.source {
            Source::Inline(text) => (inline(text), text.span()),
            Source::File(path) => {
                let text = read(path, &mut watched);
                (
                    text.and_then(|text| Arm::parse(&text, &path.value()).map_err(|e| at(path, &e))),
                    path.span(),
                )
            }
        };
        let arm = match (arm, self.error) {
            (Ok(arm), None) => arm,
            (Ok(_), Some(error)) | (Err(error), None) => return Err(error),
            (Err(more), Some(mut error)) => {
                error.combine(more);
                return Err(error);
            }
        };
        let model = match &self.values {
            Some(_) => Model::derive(arm),
            None => self.options.model(arm),
        };
        let model = model.map_err(|e| Error::new(span, e))?;
        if let Some(path) = &self.values {
            let set = model.set(self.options.parameters).map_err(|e| Error::new(span, e))?;
            let text = read(path, &mut watched)?;
            let values = Values::parse(&text, &path.value()).and_then(|values| values.of_set(&model, set));
            self.options.values = Some(values.map_err(|e| at(path, &e))?);
        }
        let items = emit::tokens(&model, &self.options).map_err(|e| Error::new(span, e))?;
        Ok(quote!(#items #watched))
    }
}

fn inline(text: &LitStr) -> Result<Arm> {
    let place = |line: usize, column: usize| match line {
        0 => String::new(),
        _ => format!("line {line}, column {column} of the text: "),
    };
    Arm::parse(&text.value(), "toml")
        .map_err(|e| all(text.span(), &e, |d| format!("{}{}", place(d.line, d.column), d.message)))
}

/// A file's text, with an item that makes the compiler watch the file.
fn read(path: &LitStr, watched: &mut TokenStream) -> Result<String> {
    // Cargo sets this for the crate that is compiled; without cargo the current folder has to do.
    let folder = std::env::var_os("CARGO_MANIFEST_DIR").unwrap_or_default();
    let full = Path::new(&folder).join(path.value());
    if let Some(full) = full.to_str() {
        watched.extend(quote!(
            const _: &[u8] = include_bytes!(#full);
        ));
    }
    dyngen::file::text(&full)
        .map_err(|e| Error::new(path.span(), format!("{}: the file cannot be read: {e}", path.value())))
}

/// What is wrong with a file, at its path.
fn at(path: &LitStr, diagnostics: &Diagnostics) -> Error {
    all(path.span(), diagnostics, ToString::to_string)
}

/// Every diagnostic as an error of the compiler.
fn all(span: Span, diagnostics: &Diagnostics, text: impl Fn(&dyngen::Diagnostic) -> String) -> Error {
    let mut errors = diagnostics.0.iter().map(|d| Error::new(span, text(d)));
    let first = errors.next().unwrap_or_else(|| Error::new(span, "the arm cannot be read"));
    errors.fold(first, |mut all, e| {
        all.combine(e);
        all
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn errors(call: &str) -> Vec<String> {
        let error = match syn::parse_str::<Request>(call) {
            Ok(request) => request.generate().err(),
            Err(e) => Some(e),
        };
        error.into_iter().flatten().map(|e| e.to_string()).collect()
    }

    #[test]
    fn every_function_that_is_not_there_is_named_with_those_that_are() {
        let found = errors("file = \"tests/arms/slider.toml\", functions = [gravity, flying, regresor]");
        assert_eq!(found.len(), 2, "{found:?}");
        assert!(found[0].contains("`flying`") && found[1].contains("`regresor`"), "{found:?}");
        assert!(found[0].contains("inverse_dynamics, "), "{found:?}");
    }

    #[test]
    fn a_call_that_is_cut_short_is_no_arm() {
        assert!(errors("\"tests/arms/slider.toml\",").is_empty());
        for call in
            ["", "file", "file =", "file = ,", "functions = 3", "functions = [1]", "parameters = [full]", "3"]
        {
            assert!(!errors(call).is_empty(), "{call}");
        }
    }
}
