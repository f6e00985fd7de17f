//! A payload on the tool's frame, whose ten inertial parameters are inputs.

use super::chain::LinkGeometry;
use super::moments::{ENTRIES, Moments};
use crate::exact::algebra::Algebra;
use crate::exact::rational;
use crate::graph::{Builder, Expr, Input};
use crate::lagrangian::elements::PlacementElements;

/// The payload of a function's inputs, in the axes and about the origin of the frame of the link that carries
/// the tool.
pub(super) fn given(b: &Builder, link: &LinkGeometry<Expr>, tool: &PlacementElements<Expr>) -> Moments<Expr> {
    body(b, link, tool, &std::array::from_fn(|i| b.input(Input::Payload(i))))
}

/// A payload of which one parameter is 1, all others 0.
pub(super) fn unit(
    b: &Builder,
    link: &LinkGeometry<Expr>,
    tool: &PlacementElements<Expr>,
    parameter: usize,
) -> Moments<Expr> {
    body(b, link, tool, &std::array::from_fn(|i| b.integer(i64::from(i == parameter))))
}

fn body(
    b: &Builder,
    link: &LinkGeometry<Expr>,
    tool: &PlacementElements<Expr>,
    parameters: &[Expr; ENTRIES],
) -> Moments<Expr> {
    let half = b.constant(&rational::ratio(1, 2));
    let in_file_frame = Moments::of_parameters(b, &half, parameters).placed_back(b, tool);
    let (sin, cos) = &link.file_turn;
    in_file_frame.turned_back_x(b, sin, cos).shifted(b, &link.file_origin)
}
