//! `dyngen inspect`.

use super::generate::function;
use super::{Failure, Set, model, print};
use dyngen::Function;
use dyngen::dynamics::FunctionGraph;
use dyngen::exact::rational;
use dyngen::graph::{Expr, Input, Node, Operations};
use dyngen::optimize::PASSES;
use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::PathBuf;
use std::process::ExitCode;

#[derive(clap::Args)]
#[command(after_help = "Example: dyngen inspect arm.toml --function gravity --pass merge")]
pub(super) struct Args {
    /// The arm file.
    arm: PathBuf,
    /// The function.
    #[arg(long, value_parser = function)]
    function: Function,
    /// The last pass to run: 'build' for the graph as the recursion makes it, or a pass of the optimiser.
    #[arg(long, value_name = "NAME", value_parser = pass, default_value = "build")]
    pass: Option<usize>,
    /// The parameter set.
    #[arg(long, value_enum, default_value = "minimal")]
    parameters: Set,
}

/// How many passes to run, by the name of the last one.
fn pass(name: &str) -> Result<usize, String> {
    let names: Vec<&str> = std::iter::once("build").chain(PASSES.iter().map(|(name, _)| *name)).collect();
    names
        .iter()
        .position(|n| *n == name)
        .ok_or_else(|| format!("there is no pass '{name}': there are {}", names.join(", ")))
}

pub(super) fn run(args: &Args) -> Result<ExitCode, Failure> {
    let model = model(&args.arm)?;
    let count = args.pass.unwrap_or(0);
    let after = |count: usize| {
        model
            .function_after(args.function, args.parameters.into(), &PASSES[..count])
            .map_err(Failure::refused)
    };
    let built = after(count)?;
    let mut text = String::new();
    for earlier in 0..=count {
        let name = if earlier == 0 { "build" } else { PASSES[earlier - 1].0 };
        let graph = if earlier == count { built.clone() } else { after(earlier)? };
        let Operations { mul, add, div, sqrt, sin_cos } = graph.operations();
        let roots = if sqrt > 0 { format!("{sqrt} sqrt, ") } else { String::new() };
        let all = graph.graph.operations(&graph.outputs);
        // A String takes every write.
        let _ = writeln!(
            text,
            "# after {name}: {mul} mul, {add} add, {div} div, {roots}{sin_cos} sin_cos; of the parameters alone: {} \
                mul, {} add",
            all.mul - mul,
            all.add - add
        );
    }
    text.push_str(&listing(&built, &model.set(args.parameters.into()).map_err(Failure::refused)?.names()));
    print(&text)?;
    Ok(ExitCode::SUCCESS)
}

/// One line a node, operands first, then the results that are not zero.
fn listing(built: &FunctionGraph, parameters: &[String]) -> String {
    let graph = &built.graph;
    let name = |node: usize| match graph.nodes()[node] {
        Node::Constant(index) => rational::to_text(graph.constant(index)),
        Node::Symbol(index, sine) => format!("{}(angle {})", if sine { "sin" } else { "cos" }, index + 1),
        Node::Input(input) => input.to_string(),
        _ => format!("x{node}"),
    };
    let signed = |e: Expr| format!("{}{}", if e.is_negative() { "-" } else { "" }, name(e.node()));
    let mut text = String::new();
    let mut used = BTreeSet::new();
    for node in graph.needed(&built.outputs) {
        let line = match graph.nodes()[node] {
            Node::Input(Input::Parameter(i)) => {
                used.insert(i);
                continue;
            }
            Node::Add(a, b) if b.is_negative() => format!("{} - {}", signed(a), name(b.node())),
            Node::Add(a, b) => format!("{} + {}", signed(a), signed(b)),
            Node::Mul(a, b) => format!("{} * {}", signed(a), signed(b)),
            Node::Div(a, b) => format!("{} / {}", signed(a), signed(b)),
            Node::Sqrt(a) => format!("sqrt({})", signed(a)),
            _ => continue,
        };
        let _ = writeln!(text, "x{node} = {line}");
    }
    let columns = built.shape.1;
    for (i, output) in built.outputs.iter().enumerate().filter(|(_, e)| **e != Expr::ZERO) {
        let _ = writeln!(text, "result[{}, {}] = {}", i / columns + 1, i % columns + 1, signed(*output));
    }
    for i in used {
        let _ = writeln!(text, "# p{} = {}", i + 1, parameters[i]);
    }
    text
}
