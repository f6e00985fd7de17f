//! The inputs of a function, and the names of its values in the code.

use crate::dynamics::FunctionGraph;
use crate::dynamics::function::Argument;
use crate::graph::{Input, Node};
use proc_macro2::Ident;
use quote::format_ident;
use std::collections::BTreeSet;

/// The inputs that a function reads.
pub(super) fn used(built: &FunctionGraph, needed: &[usize]) -> BTreeSet<Input> {
    let inputs = needed.iter().filter_map(|n| match built.graph.nodes()[*n] {
        Node::Input(input) => Some(input),
        _ => None,
    });
    inputs.collect()
}

/// The name of an argument's value at a joint.
pub(super) fn lane_name(argument: Argument, joint: usize) -> Ident {
    format_ident!("{}{}", argument.name(), joint + 1)
}
