//! The files of an inspection of logs: their content, its interpretation, and the signals over time.

use crate::report::{Figure, Files, JOINTS, Page, Panel, Series, Table, Tone, number};
use powerball_logs::log::{Inspected, InspectedTable, Log};

/// log.json and report.html.
///
/// # Errors
/// A result that is not JSON.
pub fn files(files: &[Inspected]) -> Result<Files, String> {
    let asked = serde_json::json!({ "files": files });
    Ok(Files::default().json("log.json", &asked)?.with("report.html", page(files).to_html()))
}

/// The page.
#[must_use]
pub fn page(files: &[Inspected]) -> Page {
    let names: Vec<&str> = files.iter().map(|f| f.file.as_str()).collect();
    let mut page = Page::new(format!("Logs: {}", names.join(", ")));
    page.lead("What the files contain, how it is interpreted, and the signals over time.");
    for file in files {
        of_file(&mut page, file);
    }
    page
}

fn of_file(page: &mut Page, file: &Inspected) {
    page.heading(&file.file);
    let arm = file.taken_as.as_ref();
    if let Some(log) = arm {
        page.note(
            Tone::Good,
            &format!("A log of {}: {} samples in {:.2} s.", log.arm, log.samples, log.duration),
        );
    }
    file.refused.iter().for_each(|why| page.note(Tone::Bad, why));
    file.warnings.iter().for_each(|doubt| page.note(Tone::Plain, doubt));
    for table in &file.tables {
        of_table(page, table);
    }
    let mut pairs = Table::new(["topic", "and", "overlap [s]", "apart [ms], median", "at most"]);
    for pair in &file.alignment {
        let a = pair.alignment;
        pairs.push([
            pair.a.clone(),
            pair.b.clone(),
            format!("{:.2}", a.overlap),
            format!("{:.1}", 1e3 * a.median),
            format!("{:.1}", 1e3 * a.largest),
        ]);
    }
    if !pairs.is_empty() {
        page.subheading("Topics in time");
        page.table(&pairs);
    }
    if let Some(log) = &file.log {
        page.subheading("The log as it is used");
        page.figure(&taken(log), "In SI units, with signs and faults corrected as the notes say.");
    }
}

fn of_table(page: &mut Page, table: &InspectedTable) {
    let name = if table.name.is_empty() { table.kind.as_str() } else { table.name.as_str() };
    page.subheading(name);
    if !table.name.is_empty() {
        page.paragraph(&table.kind);
    }
    let mut facts = vec![
        ("samples", table.samples.to_string()),
        ("time", table.clock.clone().unwrap_or("none".to_string())),
    ];
    facts.extend(table.duration.map(|s| ("length", format!("{s:.2} s"))));
    facts.extend(table.rate.map(|hz| ("rate", format!("{hz:.1} Hz"))));
    if table.gaps > 0 {
        let longest = table.longest_step.unwrap_or(0.0);
        facts.push(("gaps", format!("{}, the longest {longest:.3} s", table.gaps)));
    }
    if table.not_rising > 0 {
        facts.push(("time stamps that do not increase", table.not_rising.to_string()));
    }
    page.facts(facts);
    if let Some(doubt) = &table.clock_doubt {
        page.note(Tone::Plain, &format!("Time of receipt is used: {doubt}."));
    }
    let mut columns = Table::new(["column", "is", "joint", "unit", "from", "to", "missing"]);
    for column in &table.columns {
        columns.push([
            column.name.clone(),
            column.quantity.unwrap_or("left aside").to_string(),
            column.joint.clone().unwrap_or_default(),
            column.unit.clone().unwrap_or_default(),
            column.min.map(number).unwrap_or_default(),
            column.max.map(number).unwrap_or_default(),
            column.missing.to_string(),
        ]);
    }
    page.folded("columns", &columns);
    if let Some(figure) = as_it_is(table) {
        page.figure(&figure, "As it stands in the file.");
    }
}

/// Every quantity of a table over time, joint by joint.
fn as_it_is(table: &InspectedTable) -> Option<Figure> {
    let start = *table.times.first()?;
    let mut figure = Figure::new("", "time from the first sample [s]");
    let mut any = false;
    for (quantity, label) in [
        ("q", "position"),
        ("dq", "velocity"),
        ("tau", "torque"),
        ("i", "current"),
        ("temp", "temperature"),
        ("motor", "motor's side"),
    ] {
        let of = table.columns.iter().filter(|c| c.quantity == Some(quantity));
        let series: Vec<Series> = of
            .enumerate()
            .map(|(k, column)| {
                let points = table.times.iter().zip(&column.values).map(|(t, x)| (t - start, *x));
                // One name for a joint in all panels.
                let joint = column.joint.as_deref().unwrap_or_default();
                let name =
                    if joint.parse::<u32>().is_ok() { format!("joint {joint}") } else { joint.to_string() };
                Series::line(name, JOINTS[k % JOINTS.len()], points.collect())
            })
            .collect();
        if series.is_empty() {
            continue;
        }
        any = true;
        let unit = table.columns.iter().find(|c| c.quantity == Some(quantity)).and_then(|c| c.unit.clone());
        let label = unit.map_or(label.to_string(), |unit| format!("{label} [{unit}]"));
        figure = if ["q", "dq"].contains(&quantity) {
            figure.panel(series.into_iter().fold(Panel::new(label), Panel::series))
        } else {
            // A wrist's torque would be a flat line on the shoulder's axis.
            series
                .into_iter()
                .fold(figure, |figure, one| figure.panel(Panel::new(&label).height(0.5).series(one)))
        };
    }
    any.then_some(figure)
}

fn taken(log: &Log) -> Figure {
    let line = |(j, signal): (usize, &Vec<f64>)| {
        let mut points = Vec::new();
        for piece in &log.pieces {
            points.extend(piece.clone().map(|k| (log.t[k], signal[k])));
            // A gap is not a line.
            points.push((f64::NAN, f64::NAN));
        }
        Series::line(format!("joint {}", j + 1), JOINTS[j % JOINTS.len()], points)
    };
    let positions = log.q.iter().enumerate().map(line).fold(Panel::new("position [rad]"), Panel::series);
    let figure = Figure::new("", "time [s]").panel(positions);
    let torques = log.torque.iter().enumerate().map(line);
    torques.fold(figure, |figure, one| figure.panel(Panel::new("torque [N·m]").height(0.5).series(one)))
}
