//! The parameter sets have the sizes, ranks and relations that an independent numeric regressor gave.

#![allow(clippy::unwrap_used, clippy::panic)]

use dyngen::Arm;
use dyngen::base::SetKind;
use dyngen::base::sets::Sets;
use dyngen::lagrangian::elements::angle_symbols;
use powerball_workspace::{arm, arm_text, paper_arm_with_ratios, parse};

fn sets(arm: &Arm) -> Sets {
    Sets::derive(arm, &angle_symbols(arm)).unwrap()
}

fn counts(arm: &Arm) -> (usize, usize) {
    let sets = sets(arm);
    let count = |kind| sets.get(kind).map_or(0, |s| s.parameters.len());
    (count(SetKind::Minimal), count(SetKind::Symbolic))
}

#[test]
fn the_papers_arm_has_44_kept_29_symbolic_and_19_minimal_parameters() {
    let arm = arm("arm");
    assert_eq!(arm.all_parameters().len(), 66);
    assert_eq!(arm.kept_parameters().len(), 44);
    assert_eq!(counts(&arm), (19, 29));
}

#[test]
fn gear_ratios_change_the_rank() {
    let k = |k: [u32; 6]| counts(&paper_arm_with_ratios(k.map(Some))).0;
    assert_eq!(k([100; 6]), 23);
    assert_eq!(k([7; 6]), 23);
    assert_eq!(k([1, 1, 100, 100, 100, 1]), 22);
    assert_eq!(counts(&paper_arm_with_ratios([None; 6])), (19, 23));
}

#[test]
fn without_symmetries_40_with_rotors_and_36_without() {
    let strip = |mut arm: Arm| {
        arm.joints.iter_mut().for_each(|j| j.zero.clear());
        arm.groupings.clear();
        arm
    };
    assert_eq!(counts(&strip(paper_arm_with_ratios([Some(100); 6]))).0, 40);
    assert_eq!(counts(&strip(paper_arm_with_ratios([None; 6]))).0, 36);
}

#[test]
fn known_arms_have_their_known_counts() {
    for (name, minimal, symbolic) in
        [("puma560", 36, 42), ("ur5e", 36, 0), ("panda", 43, 51), ("stanford", 33, 37), ("scara", 8, 0)]
    {
        let (m, s) = counts(&arm(name));
        assert_eq!(m, minimal, "{name} minimal");
        if symbolic > 0 {
            assert_eq!(s, symbolic, "{name} symbolic");
        }
    }
}

#[test]
fn table_3_is_exact_with_ratio_1_and_has_rank_19_and_ten_relations() {
    let sets = sets(&arm("arm"));
    let published = sets.get(SetKind::Published).unwrap();
    assert_eq!(published.parameters.len(), 29);
    assert!(published.exact);
    assert_eq!(published.rank, 19);
    assert_eq!(published.relations.len(), 10);
    let symbolic = sets.get(SetKind::Symbolic).unwrap();
    assert_eq!((symbolic.rank, symbolic.relations.len()), (19, 10));
    // Some of the ten, by hand: the first moments along parallel axes shift by a2 and d4 alone.
    for relation in ["Ixz2 = 20/7*mz2", "my3 = mz2", "my5 = mz4", "mz6 = mz5"] {
        assert!(published.relations.iter().any(|r| r == relation), "{relation} in {:?}", published.relations);
    }
}

#[test]
fn table_3_loses_the_rotors_whose_ratio_is_not_1() {
    for (joint, name) in [(1, "Im1"), (2, "Im2"), (6, "Im6")] {
        let mut ratios = [Some(1); 6];
        ratios[joint - 1] = Some(100);
        let sets = sets(&paper_arm_with_ratios(ratios));
        let published = sets.get(SetKind::Published).unwrap();
        assert!(!published.exact);
        let lost: Vec<String> = published.lost.iter().map(|(p, _)| p.to_string()).collect();
        assert_eq!(lost, [name]);
        assert!(published.lost[0].1.contains("ratio k = 100"), "{}", published.lost[0].1);
    }
    let sets = sets(&paper_arm_with_ratios([1, 1, 100, 100, 100, 1].map(Some)));
    let published = sets.get(SetKind::Published).unwrap();
    assert_eq!((published.exact, published.rank), (true, 22));
}

#[test]
fn lengths_decide_what_the_numbers_relate() {
    // The file's text with a2 as 0.35 or 7/20 is the same number; another length leaves the counts alone.
    let text = arm_text("arm");
    let other = parse(&text.replace("a = 0.35", "a = 0.4321"));
    assert_eq!(counts(&other), (19, 29));
}
