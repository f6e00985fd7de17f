//! An explanation as sections of a page.

use crate::report::sections;
use crate::report::{BarPairs, Figure, Files, Ink, Page, Panel, Series, Table, Tone, band_of, number};
use powerball_controller::JointNumber;
use powerball_explanation::explain::{Change, Explained, NamedEffect, Shown, TorqueCurve};

/// explained.json, model.json and report.html.
///
/// # Errors
/// A result that is no JSON.
pub fn files(explained: &Explained) -> Result<Files, String> {
    let mut page = Page::new(format!("What the model of {} lacks", explained.arm));
    add_to_page(&mut page, explained);
    let files = Files::default().json("explained.json", explained)?.json("model.json", &explained.model)?;
    Ok(files.with("report.html", page.to_html()))
}

/// Adds everything that an explanation says to a page: the answer first; then errors, effects with their
/// evidence, torques over time, what stays, what the columns are, and what was found in the logs.
pub fn add_to_page(page: &mut Page, explained: &Explained) {
    if let Some(conventions) = explained.conventions.as_ref().filter(|c| c.is_remarkable()) {
        sections::columns_verdict(page, conventions);
    }
    answer(page, explained);
    logs(page, explained);
    errors(page, explained);
    effects(page, explained);
    laws(page, explained);
    if let Some(joints) = &explained.transmission {
        sections::add_transmissions(page, joints);
    }
    torques(page, explained);
    rest(page, explained);
    if let Some(conventions) = &explained.conventions {
        page.heading("What the columns of the logs are");
        sections::add_conventions(page, conventions);
    }
    notes(page, explained);
    page.words(&WORDS);
}

/// The words that a reader may not know, in the order of the page.
const WORDS: [(&str, &str); 12] = [
    (
        "base model",
        "The rigid arm with its rotors and the friction of Eq. 16 (two tanh steps and a viscous part), \
        before anything was added.",
    ),
    (
        "error",
        "The rms of measured less predicted torque on the logs that were not fitted; before: of the base \
        model, after: with all that was named.",
    ),
    (
        "95 % interval",
        "Where the change of the error lies in 95 of 100 such logs. Where it holds 0, no change is known.",
    ),
    ("torque left", "The error after, as a share of the rms of the joint's torque."),
    (
        "verdict",
        "At the noise floor: what is left is hardly more than the noise of the measurement. Predicted: at \
        most a tenth of the torque's rms is left. Improved: more is left, and the error fell. Not predicted: \
        more is left, and no error fell.",
    ),
    (
        "right in",
        "How often a name with such evidence is right, in 100 names on arms whose effects are known \
        (docs/study.md).",
    ),
    (
        "held-out gain",
        "By how much the squared error falls on stretches of the fitted logs that took no part in the fit.",
    ),
    ("p", "The probability of such an effect by chance, over all that was tried."),
    (
        "evidence",
        "The gain of the name over that of the next best name. Near 1 these logs cannot tell the two apart.",
    ),
    ("left over", "The share of the base model's error beyond noise that is still there with all effects."),
    ("noise floor", "What white noise of the measurement alone would leave, in the band of the fit."),
    (
        "band",
        "The frequencies up to which measured and modelled torque are compared; both pass the same filter.",
    ),
];

/// What is different in which log.
fn logs(page: &mut Page, explained: &Explained) {
    if explained.logs.iter().all(|log| log.like_the_others) {
        return;
    }
    page.heading("Which logs differ");
    let mut table = Table::new(["log", "differs by", "joints", "from [s]", "to [s]", "share of its excess"]);
    for log in explained.logs.iter() {
        let row = |cells: [String; 5]| -> [String; 6] {
            let [effect, joints, from, to, share] = cells;
            [log.log.clone(), effect, joints, from, to, share]
        };
        let no = String::new;
        if log.like_the_others {
            table.push(row(["like the others".into(), no(), no(), no(), no()]));
        } else if log.differs.is_empty() {
            table.push(row(["nothing that was tried says why".into(), no(), no(), no(), no()]));
        }
        for d in &log.differs {
            let joints: Vec<String> = d.joints.iter().map(ToString::to_string).collect();
            let times = [d.start_time, d.end_time].map(|t| format!("{t:.1}"));
            let [from, to] = times;
            table.push(row([d.effect.clone(), joints.join(", "), from, to, percent(d.share)]));
        }
    }
    page.table(&table);
}

/// Each joint's error before and after with how far it is explained, the names, and what to do about the
/// rest.
fn answer(page: &mut Page, explained: &Explained) {
    page.heading("The answer");
    let (before, after) = (&explained.before.validate, &explained.after.validate);
    let mut table = Table::new([
        "joint",
        "error before",
        "error after",
        "change, 95 % interval",
        "torque left",
        "verdict",
        "band [Hz]",
    ]);
    for v in &explained.verdict {
        let j = v.joint.index();
        let unit = if explained.sliding.get(j).copied().unwrap_or(false) { "N" } else { "N·m" };
        let changed = explained.held_out_change.iter().find(|c| c.joint == v.joint);
        table.push([
            v.joint.to_string(),
            format!("{} {unit}", number(before.rms[j])),
            format!("{} {unit}", number(after.rms[j])),
            changed.map_or_else(String::new, change),
            if v.left.is_nan() { "–".to_string() } else { percent(v.left) },
            v.state.to_string(),
            band_of(after.band[j]),
        ]);
    }
    page.table(&table);
    if explained.effects.is_empty() {
        page.paragraph(nothing_named(explained));
    } else {
        let mut table = Table::new(["what the model lacked", "joints", "size", "right in", "logs"]);
        for effect in &explained.effects {
            table.push([
                effect.effect.clone(),
                list(&effect.joints),
                effect.size(&explained.sliding),
                format!("{:.0} of 100", 100.0 * effect.probability),
                logs_of(effect),
            ]);
        }
        page.table(&table);
    }
    for v in explained.verdict.iter().filter(|v| !v.advice.is_empty()) {
        page.paragraph(&format!("Joint {}: {}.", v.joint, v.advice));
    }
}

/// The logs that an effect is in, and whether it is seen in some of those that it should be in.
fn logs_of(effect: &NamedEffect) -> String {
    match effect.again {
        Some(again) if effect.in_some_logs => {
            format!("seen in some: {} of {} searches on fewer logs give it", again.found, again.of)
        }
        _ => effect.logs.join(", "),
    }
}

/// A change of an error with its interval; an interval that holds 0 is no change that is known.
#[must_use]
pub fn change(change: &Change) -> String {
    let percent = |share: f64| format!("{:+.0}", 100.0 * share).replace('-', "\u{2212}");
    let [low, high] = change.interval;
    // What the table's digits do not show.
    if low.abs().max(high.abs()) < 0.005 {
        return "none".to_string();
    }
    let clear = match low <= 0.0 && high >= 0.0 {
        true => "unclear".to_string(),
        false => format!("{} %", percent(change.rms)),
    };
    format!("{clear} ({} to {})", percent(low), percent(high))
}

/// What is reported where no effect was named: never more than the logs show.
#[must_use]
pub fn nothing_named(explained: &Explained) -> &'static str {
    if !explained.laws.is_empty() {
        "No effect was named: what the model lacks has no name here, and is given as a formula."
    } else if explained.verdict.iter().all(|v| v.state.is_good()) {
        "No effect was named: little is left of the torques, and these logs do not show that the model lacks \
         anything."
    } else {
        "No effect was named, but much is left on some joints (see the verdict): the model lacks something \
         there that these logs do not show."
    }
}

fn errors(page: &mut Page, explained: &Explained) {
    page.heading("Errors on the held-out path");
    page.bars(
        &error_bars(explained),
        "The dashed lines are what white measurement noise alone would leave in the band.",
    );
    let share = |(joint, share): (usize, &f64)| format!("joint {} {}", joint + 1, percent(*share));
    let shares: Vec<String> = explained.explainable.iter().enumerate().map(share).collect();
    page.paragraph(&format!(
        "Of the squared error that is left, some smooth law of positions, velocities and directions would \
         take away here: {}. Where that is much, a law is missing. Where it is little, the rest is noise, or \
         depends on something else than the joints' states.",
        shares.join(", ")
    ));
}

/// Held-out errors by joint, before and after.
#[must_use]
pub fn error_bars(explained: &Explained) -> BarPairs {
    let (before, after) = (&explained.before.validate, &explained.after.validate);
    let widest = after.band.iter().fold(0.0, |a: f64, b| a.max(*b));
    let title = format!("Torque error on logs that were not fitted, {} Hz", band_of(widest));
    let errors = before.rms.iter().zip(&after.rms);
    let bars = BarPairs::new(title, "rms [N·m]", ["base model", "with what was named"]);
    errors.zip(&explained.noise_floor).enumerate().fold(bars, |bars, (joint, ((before, after), floor))| {
        let band = explained.after.validate.band[joint];
        let name = match band < widest {
            true => format!("joint {}, {} Hz", joint + 1, band_of(band)),
            false => format!("joint {}", joint + 1),
        };
        bars.pair_with_floor(name, *before, *after, *floor)
    })
}

fn effects(page: &mut Page, explained: &Explained) {
    if explained.effects.is_empty() {
        return;
    }
    page.heading("The evidence");
    let mut table = Table::new(["effect", "joints", "held-out gain", "p", "evidence", "left over"]);
    for effect in &explained.effects {
        let gain = effect.held_out_gain.iter().copied().fold(f64::INFINITY, f64::min);
        table.push([
            effect.effect.clone(),
            list(&effect.joints),
            percent(gain),
            number(effect.p_value),
            format!("{:.2} times", effect.margin),
            percent(effect.leftover),
        ]);
    }
    page.table(&table);
    page.paragraph(
        "Gain: by how much the squared error of folds that were left out falls, on the joint where it falls \
         least. p: probability of as much by chance, over all that was tried. Evidence: against that of the \
         next best name. Left over: share of the residual's excess over noise that stays on these joints.",
    );
    let mut figures: Vec<&Shown> = explained.shown.iter().collect();
    figures.sort_by_key(|shown| shown.joint);
    for shown in figures {
        page.figure(&effect_figure(shown), "");
    }
    if !explained.shown.is_empty() {
        page.paragraph(
            "Each figure shows the residual of the fitted logs over the signal that the effect depends on: \
                grey dots without this effect but \
             with all others, green dots with it. Lines are means over equal numbers of samples. Where the \
             law is right, the orange line \
             lies on the purple one and the blue line on zero.",
        );
    }
    for effect in explained.effects.iter().filter(|e| !e.rivals.is_empty()) {
        page.folded(
            &format!("Rivals of {} on joint {}", effect.effect, list(&effect.joints)),
            &rivals(effect),
        );
    }
}

/// What is there without a name.
fn laws(page: &mut Page, explained: &Explained) {
    if explained.laws.is_empty() {
        return;
    }
    page.heading("What has no name");
    page.paragraph(
        "No effect with a name explains this torque, and a smooth function of two joints does, on the other \
         path too: a hose, a cable or a linkage between them. The formula is in the model; what it is of you \
         must see on the arm.",
    );
    for law in &explained.laws {
        page.paragraph(&law.sentence());
    }
}

/// The residual over the signal that shows an effect.
#[must_use]
pub fn effect_figure(shown: &Shown) -> Figure {
    let rows = |k: usize| shown.rows.iter().map(|row| (row[0], row[k])).collect();
    let means = |k: usize| shown.means.iter().map(|mean| (mean[0], mean[k])).collect();
    let what = if shown.against_motion { "residual against motion [N·m]" } else { "residual [N·m]" };
    let panel = Panel::new(what)
        .height(1.3)
        .series(Series::points("without the effect", Ink::Grey, rows(1)))
        .series(Series::points("with it", Ink::Green, rows(2)))
        .series(Series::broad("mean of what it adds", Ink::Orange, means(3)))
        .line("mean without", Ink::Purple, means(1))
        .line("mean with it", Ink::Blue, means(2));
    Figure::new(format!("{} on joint {}", shown.effect, shown.joint), shown.signal.as_str()).panel(panel)
}

fn rivals(effect: &NamedEffect) -> Table {
    let mut table = Table::new(["name", "why it was not given"]);
    for rival in &effect.rivals {
        table.push([rival.effect.clone(), rival.why_not.clone()]);
    }
    table
}

fn torques(page: &mut Page, explained: &Explained) {
    page.heading("Torques on the held-out path");
    let moving = explained.curves.iter().enumerate().filter(|(_, curve)| !curve.t.is_empty());
    for (joint, curve) in moving {
        page.figure(&figure(joint, curve), "");
    }
    page.paragraph("The logs follow each other without their pauses. Phases of rest are left out.");
}

fn figure(joint: usize, curve: &TorqueCurve) -> Figure {
    let measured = curve.points(|row| curve.measured[row]);
    let predicted = curve.points(|row| curve.measured[row] - curve.after[row]);
    let torque = Panel::new("torque [N·m]").line("measured", Ink::Blue, measured).series(Series::line(
        "predicted with the effects",
        Ink::Orange,
        predicted,
    ));
    let residual = Panel::new("error [N·m]")
        .height(0.75)
        .line("error of the base model", Ink::Grey, curve.points(|row| curve.before[row]))
        .line("error with the effects", Ink::Green, curve.points(|row| curve.after[row]));
    Figure::new(format!("Joint {}", joint + 1), "time along the logs [s]").panel(torque).panel(residual)
}

fn rest(page: &mut Page, explained: &Explained) {
    page.heading("What stays open");
    match &explained.unattributed {
        Some(rest) => {
            let signals = rest.depends_on.join(", ");
            let text = format!(
                "The residual of joint {} still depends on {signals}, and nothing in the library explains it \
                    well enough to be named.",
                list(&rest.joints)
            );
            page.note(Tone::Bad, &text);
            let mut table = Table::new(["considered", "why it was not given"]);
            rest.considered.iter().for_each(|r| table.push([r.effect.clone(), r.why_not.clone()]));
            if !table.is_empty() {
                page.folded("Names that were considered", &table);
            }
        }
        None => page.paragraph("Nothing that these logs could show."),
    }
    if let Some(experiment) = &explained.experiment {
        let why = &experiment.why;
        match experiment.decided {
            Some(name) => page.note(Tone::Good, &format!("The experiment decides for {name}: {why}.")),
            None => page.note(Tone::Plain, &format!("The experiment does not decide: {why}.")),
        }
    }
    if let Some(next) = &explained.next_experiment {
        page.note(Tone::Plain, &format!("Next experiment: {}", next.advice));
    }
    let chance = &explained.false_positives;
    let without = match chance.without {
        0 => String::new(),
        n => format!(" (constant torques are left out: {n}, as they are the same at every time)"),
    };
    page.paragraph(&format!(
        "How often the rule is wrong on these data: {} of {} effects that cannot be there were \
         accepted{without}. The residuals are worth {} independent samples.",
        chance.accepted, chance.surrogates, explained.effective_samples
    ));
}

/// What was found in the logs and the arm file; a note that is the same for several logs is written once.
fn notes(page: &mut Page, explained: &Explained) {
    if explained.warnings.is_empty() {
        return;
    }
    let mut counted: Vec<(String, usize)> = Vec::new();
    for warning in &explained.warnings {
        let log = explained.logs.iter().find(|log| warning.starts_with(&log.log));
        let text = log.map_or(warning.as_str(), |log| &warning[log.log.len()..]);
        match counted.iter_mut().find(|(known, _)| log.is_some() && known == text) {
            Some((_, count)) => *count += 1,
            None if log.is_some() => counted.push((text.to_string(), 1)),
            None => counted.push((warning.clone(), 0)),
        }
    }
    let mut table = Table::new(["found in the logs and the arm file"]);
    for (text, count) in counted {
        let whole = || explained.warnings.iter().find(|w| w.ends_with(&text)).cloned().unwrap_or_default();
        table.push([match count {
            0 => text,
            1 => whole(),
            _ => format!("{count} logs{text}"),
        }]);
    }
    page.folded(&format!("{} notes on the logs and the arm file", explained.warnings.len()), &table);
}

fn list(joints: &[JointNumber]) -> String {
    joints.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ")
}

fn percent(share: f64) -> String {
    format!("{:.1} %", 100.0 * share)
}
