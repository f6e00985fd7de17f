//! Lines of straight-line code in the languages that write values, sums, fields and indices as C does.

use super::angles::{Term, terms};
use super::statement::{self, Form, Value, input_of};
use crate::dynamics::FunctionGraph;
use crate::dynamics::function::Argument;
use crate::graph::{Graph, Input, JointSum, Node};
use crate::model::Model;
use std::collections::BTreeSet;

/// Where such languages differ.
pub(super) struct Syntax {
    /// What stands before the name of a value.
    pub(super) value: &'static str,
    /// What stands between a struct that was passed and its field.
    pub(super) field: &'static str,
    /// A number, rounded to those of the file.
    pub(super) number: fn(f64) -> String,
    /// The function that gives a·b + c.
    pub(super) fused: &'static str,
    /// The function that gives √a.
    pub(super) root: &'static str,
}

impl Syntax {
    /// The lines of a graph's nodes.
    pub(super) fn statements(
        &self,
        model: &Model,
        graph: &Graph,
        needed: &[usize],
        form: &Form,
    ) -> Vec<String> {
        let line = |node: &usize| {
            let value = match statement::value(model, graph, *node, form)? {
                Value::Number(x) => (self.number)(x),
                Value::Sum(x, y) => format!("{x} + {y}"),
                Value::Difference(x, y) => format!("{x} - {y}"),
                Value::NegativeSum(x, y) => format!("-{x} - {y}"),
                Value::Product(x, y) => format!("{x} * {y}"),
                Value::Quotient(x, y) => format!("{x} / {y}"),
                Value::Root { of, negative } => {
                    format!("{}({}{of})", self.root, if negative { "-" } else { "" })
                }
                Value::Fused { factors: [x, y], addend, negative } => {
                    let [first, third] = negative.map(|minus| if minus { "-" } else { "" });
                    format!("{}({first}{x}, {y}, {third}{addend})", self.fused)
                }
            };
            Some(self.named(&statement::value_name(graph, *node), &value))
        };
        needed.iter().filter_map(line).collect()
    }

    fn named(&self, name: &str, value: &str) -> String {
        format!("{} {name} = {value};", self.value)
    }

    /// The lines that name what a function reads of the struct of sines and cosines.
    pub(super) fn of_trig(&self, model: &Model, used: &BTreeSet<Input>) -> Vec<String> {
        let sums = || model.angles().taken().iter().copied().enumerate();
        let sines = sums().map(|(k, sum)| ("sin", k, Input::Sin(sum)));
        let cosines = sums().map(|(k, sum)| ("cos", k, Input::Cos(sum)));
        let places = (0..model.arm().dof()).map(|i| ("position", i, Input::Position(i)));
        sines
            .chain(cosines)
            .chain(places)
            .filter(|(.., input)| used.contains(input))
            .map(|(field, k, input)| {
                self.named(&input.to_string(), &format!("trig{}{field}[{k}]", self.field))
            })
            .collect()
    }

    /// The lines that name what a function reads of another argument, of which `prepared` values are made of
    /// the parameters.
    pub(super) fn of_argument(
        &self,
        built: &FunctionGraph,
        argument: Argument,
        prepared: usize,
        used: &BTreeSet<Input>,
    ) -> Vec<String> {
        let array = match argument {
            Argument::Parameters => format!("prepared{}values", self.field),
            other => other.name().to_string(),
        };
        (0..argument.length(built.joints, prepared))
            .map(|i| (i, input_of(argument, i)))
            .filter(|(_, input)| used.contains(input))
            .map(|(i, input)| self.named(&input.to_string(), &format!("{array}[{i}]")))
            .collect()
    }

    /// The lines that name what a graph reads of the parameters.
    pub(super) fn of_parameters(&self, graph: &Graph, needed: &[usize]) -> Vec<String> {
        let read = needed.iter().filter_map(|n| match graph.nodes()[*n] {
            Node::Input(input @ Input::Parameter(i)) => {
                Some(self.named(&input.to_string(), &format!("parameters[{i}]")))
            }
            _ => None,
        });
        read.collect()
    }

    /// An angle of the joints' positions.
    pub(super) fn angle(&self, model: &Model, sum: JointSum) -> String {
        let (terms, offset) = terms(model.angles(), sum);
        let mut text = String::new();
        for (k, Term { negative, ratio, coordinate }) in terms.into_iter().enumerate() {
            text += match (k, negative) {
                (0, _) => "",
                (_, false) => " + ",
                (_, true) => " - ",
            };
            text += &match ratio {
                Some(ratio) => format!("({} * q[{coordinate}])", (self.number)(ratio)),
                None => format!("q[{coordinate}]"),
            };
        }
        offset.map_or(text.clone(), |offset| format!("{text} + {}", (self.number)(offset)))
    }
}
