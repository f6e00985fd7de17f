//! Layouts for programs that show our MCAP recordings: one for Foxglove and one for PlotJuggler, by the
//! topics and joints of the file.

use serde_json::{Map, Value, json};
use std::io;
use std::path::Path;

/// Colours of the lines of several joints, in order.
const COLOURS: [&str; 8] =
    ["#1f77b4", "#d62728", "#2ca02c", "#9467bd", "#ff7f0e", "#17becf", "#8c564b", "#e377c2"];

/// The content of an MCAP.
#[derive(Clone, Copy, Debug)]
pub struct Held<'a> {
    /// The names of its joints, as `/joint_states` has them.
    pub joints: &'a [String],
    /// Whether velocities are among the joint states.
    pub velocities: bool,
    /// Whether each joint has a topic with measured, predicted and residual torque.
    pub torques: bool,
}

/// One plot: its title, and of each line its label, its topic, its field, and the place of its joint.
struct Plot<'a> {
    title: String,
    lines: Vec<Line<'a>>,
}

struct Line<'a> {
    label: &'a str,
    colour: &'static str,
    of: Of<'a>,
}

/// Whose values a line has.
enum Of<'a> {
    /// A quantity of `/joint_states`, of a joint by its place and name.
    State(&'static str, usize, &'a str),
    /// The rate of a position, by its place.
    Rate(usize),
    /// A member of the torques of a joint.
    Torque(&'a str, &'static str),
}

/// Writes both layouts next to an MCAP: `NAME.foxglove.json` and `NAME.plotjuggler.xml`.
pub fn write(mcap: &Path, held: Held<'_>) -> io::Result<()> {
    let columns = plots(held);
    std::fs::write(mcap.with_extension("foxglove.json"), foxglove(&columns).to_string())?;
    std::fs::write(mcap.with_extension("plotjuggler.xml"), plotjuggler(&columns))
}

/// Two columns: all joints together, and the torque of each.
fn plots(held: Held<'_>) -> [Vec<Plot<'_>>; 2] {
    let colour = |k: usize| COLOURS[k % COLOURS.len()];
    let all = |title: &str, of: fn(usize, &str) -> Of<'_>| {
        let lines = held.joints.iter().enumerate();
        let lines = lines.map(|(k, joint)| Line { label: joint, colour: colour(k), of: of(k, joint) });
        Plot { title: title.into(), lines: lines.collect() }
    };
    let mut left = vec![all("position [rad or m]", |k, joint| Of::State("position", k, joint))];
    left.push(match held.velocities {
        true => all("velocity [rad/s or m/s]", |k, joint| Of::State("velocity", k, joint)),
        false => all("velocity [rad/s or m/s]", |k, _| Of::Rate(k)),
    });
    if !held.torques {
        left.push(all("torque [N·m or N]", |k, joint| Of::State("effort", k, joint)));
        return [left, Vec::new()];
    }
    left.push(all("residual torque [N·m or N]", |_, joint| Of::Torque(joint, "residual")));
    let each = held.joints.iter().map(|joint| Plot {
        title: format!("torque of {joint} [N·m or N]"),
        lines: [("measured", COLOURS[0]), ("predicted", COLOURS[1])]
            .map(|(member, colour)| Line { label: member, colour, of: Of::Torque(joint, member) })
            .into(),
    });
    [left, each.collect()]
}

/// <https://docs.foxglove.dev/docs/visualization/message-path-syntax>
fn foxglove(columns: &[Vec<Plot<'_>>; 2]) -> Value {
    let path = |of: &Of<'_>| match of {
        Of::State(quantity, k, _) => format!("/joint_states.{quantity}[{k}]"),
        Of::Rate(k) => format!("/joint_states.position[{k}].@derivative"),
        Of::Torque(joint, member) => {
            let plain = joint.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_' || b == b'/');
            let quote = if plain { "" } else { "\"" };
            format!("{quote}/torque/{}{quote}.{member}", joint.replace('"', "\\\""))
        }
    };
    let mut configs = Map::new();
    let mut column = |plots: &[Plot<'_>], side: &str| -> Option<Value> {
        let mut below: Option<(Value, usize)> = None;
        for (k, plot) in plots.iter().enumerate().rev() {
            let paths = plot.lines.iter().map(|line| {
                json!({ "value": path(&line.of), "enabled": true, "timestampMethod": "receiveTime", "label": line.label,
                    "color": line.colour })
            });
            let id = format!("Plot!{side}{k}");
            let config = json!({
                "title": plot.title, "paths": paths.collect::<Vec<_>>(), "showXAxisLabels": true, "showYAxisLabels": true,
                "showLegend": true, "legendDisplay": "floating", "showPlotValuesInLegend": false, "isSynced": true,
                "xAxisVal": "timestamp", "sidebarDimension": 240,
            });
            configs.insert(id.clone(), config);
            below = Some(match below {
                None => (id.into(), 1),
                Some((node, count)) => {
                    let share = 100.0 / (count + 1) as f64;
                    let node = json!({ "direction": "column", "first": id, "second": node, "splitPercentage": share });
                    (node, count + 1)
                }
            });
        }
        below.map(|(node, _)| node)
    };
    let layout = match (column(&columns[0], "left"), column(&columns[1], "right")) {
        (Some(first), Some(second)) => json!({ "direction": "row", "first": first, "second": second }),
        (first, second) => first.or(second).unwrap_or_default(),
    };
    json!({
        "configById": configs, "globalVariables": {}, "userNodes": {}, "playbackConfig": { "speed": 1 }, "layout": layout,
    })
}

fn plotjuggler(columns: &[Vec<Plot<'_>>; 2]) -> String {
    // PlotJuggler computes rates only on request of the user.
    let drawn = |plot: &&Plot<'_>| plot.lines.iter().any(|line| !matches!(line.of, Of::Rate(_)));
    let columns = columns.each_ref().map(|plots| plots.iter().filter(drawn).collect::<Vec<_>>());
    let mut text = String::from("<?xml version='1.0' encoding='UTF-8'?>\n<root>\n");
    text.push_str(" <tabbed_widget parent=\"main_window\" name=\"Main Window\">\n");
    for (plots, tab) in columns.iter().zip(["joints", "torques"]).filter(|(plots, _)| !plots.is_empty()) {
        let share = format!("{:.6}", 1.0 / plots.len() as f64);
        let sizes = vec![share; plots.len()].join(";");
        text.push_str(&format!("  <Tab containers=\"1\" tab_name=\"{tab}\">\n   <Container>\n"));
        let count = plots.len();
        text.push_str(&format!("    <DockSplitter orientation=\"-\" sizes=\"{sizes}\" count=\"{count}\">\n"));
        for plot in plots {
            text.push_str(&format!("     <DockArea name=\"{}\">\n", escaped(&plot.title)));
            text.push_str(
                "      <plot mode=\"TimeSeries\" style=\"Lines\" flip_x=\"false\" flip_y=\"false\">\n",
            );
            text.push_str("       <limitY/>\n");
            for line in &plot.lines {
                let name = match &line.of {
                    Of::State(quantity, _, joint) => format!("/joint_states/{joint}/{quantity}"),
                    Of::Torque(joint, member) => format!("/torque/{joint}/{member}"),
                    Of::Rate(_) => continue,
                };
                let (name, colour) = (escaped(&name), line.colour);
                text.push_str(&format!("       <curve name=\"{name}\" color=\"{colour}\"/>\n"));
            }
            text.push_str("      </plot>\n     </DockArea>\n");
        }
        text.push_str("    </DockSplitter>\n   </Container>\n  </Tab>\n");
    }
    text.push_str("  <currentTabIndex index=\"0\"/>\n </tabbed_widget>\n");
    text.push_str(" <use_relative_time_offset enabled=\"1\"/>\n</root>\n");
    text
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;")
}
