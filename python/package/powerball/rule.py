"""Every threshold that decides what ``explain`` says."""

from __future__ import annotations

import dataclasses
import json
from dataclasses import dataclass


@dataclass(frozen=True)
class Rule:
    """The thresholds of the rule that accepts, names or refuses effects.

    The defaults are those of every published figure. A gain is a fall of χ², the squared error in units of
    independent samples; a score is a gain after penalties for coefficients and for having searched.

    ``explain(..., rule=Rule(least_score=20.0))``. Only effects that pass every threshold are named, so a
    stricter one names less; what the study says of right and wrong names holds for the defaults alone.
    """

    #: Effects added at most.
    most_steps: int = 12
    #: Least score of an effect, in units of χ²: e^(−10/2) is a likelihood ratio of 150 after the penalties.
    #: An experiment must promise it, and a log has the payload or the push of another one where that
    #: explains so much more.
    least_score: float = 10.0
    #: Penalty for each coefficient: what one coefficient gains by chance, twice over (Akaike). A setting is
    #: refined for more than half of it.
    per_coefficient: float = 2.0
    #: Probability of accepting anything at all where nothing is missing, over all joints and candidates;
    #: above the band that of a ripple, over all joints and orders; that of a wrong decision between two
    #: names by an experiment; that of calling an effect missing in one of eight octaves of time. A
    #: candidate must exceed all but this share of its time-shift surrogates.
    family_wise: float = 0.01
    #: The held-out squared error must fall by this share on average over folds: 1 % of the rms, below which
    #: no user would notice. A signal that explains less of a residual's variance is not reported, and a
    #: group with fewer columns is preferred where the better one's score is larger by less than this share
    #: or ``as_good_score``.
    least_gain: float = 0.02
    #: What is below this share of a whole is next to nothing: what one fold may lose of its squared error;
    #: what is left of a joint's torque and needs no name; what a term of another class gains of an accepted
    #: one whose law it corrects, since laws are wrong by a few percent; how far apart the starts of two
    #: runs are, of each joint's travel; the share of accepted surrogates, above which a reader is warned.
    negligible: float = 0.05
    #: What is below this share is little, and a change by more is clear. A joint is predicted where no more
    #: of its torque's rms is left; where all but this share is left, a model predicts almost nothing. What
    #: lowers the rms of its joints by more needs no folds where it does so on the validation set and the
    #: other way round, and position servos need no significance for it, as few seconds are too few blocks.
    #: A name is taken back where without its effect the held-out squared error of all joints is smaller by
    #: more; what is in validation logs only must not raise that of a joint by more; on repeats of one path,
    #: where whoever has more parameters fits the error that is the same in all of them, the per-joint fit
    #: must lower it by more. Two paths, two parts of a residual, or the models of two names are the same
    #: but for this share. A force in all but this share of a log's rests is that of a carried body.
    little: float = 0.1
    #: What is more than this share is most of a thing: half. An event of some seconds (a push) must explain
    #: most of what its time has more of squared error than others; another log has the same push where it
    #: has it for most of its time; an effect most of which is missing in some octave is not the effect that
    #: it is called; what either way round adds must be mostly the same, by their correlation.
    most: float = 0.5
    #: What is more than this share is nearly all of a thing: four of five. The held-out squared error must
    #: fall in nearly all folds; a log has the same push if that also explains nearly all of the force's own
    #: torque, since a push of another size or direction is another one.
    nearly_all: float = 0.8
    #: Squared errors that differ by this factor are unlike. A validation log whose error is larger than
    #: that of the fitted logs by it holds something that they do not; for position servos a mass or a gain
    #: is looked for in such a log, and where none takes away most of its squared error, it is unlike the
    #: others from that ratio of the rms on. A residual is coloured where the variance of its slow means is
    #: larger than that of white noise by it.
    unlike: float = 2.0
    #: Blocks that count as independent last this many autocorrelation times of what is left …
    block_memories: float = 3.0
    #: … but not less, s …
    shortest_block: float = 0.5
    #: … and not more, s. Two events this close count as one whose time is a little off.
    longest_block: float = 2.0
    #: Share of its time-shift surrogates whose score an event of some seconds must exceed: shifted in time
    #: it falls onto others of its kind for at most a quarter of a log.
    event_surrogate_level: float = 0.75
    #: Surrogates of a step, and those that state the false-positive rate. A tenth of it where a search is
    #: done again for each (an effect's for logs and times, that for ripple above the band): these must be
    #: enough for ``family_wise``.
    surrogates: int = 2000
    #: A shifted column that still correlates so much with the unshifted one (a periodic motion) is no
    #: surrogate.
    surrogate_correlation: float = 0.4
    #: A term of the class of an accepted one, on the same joint, that gains less than this share of it
    #: corrects that one's law and is no effect of its own.
    only_corrects_class: float = 0.15
    #: Scores that differ by less are as good: a likelihood ratio of 4.
    as_good_score: float = 3.0
    #: Two names whose gains differ by less than this factor cannot be distinguished by these data.
    least_margin: float = 1.1
    #: A name that is not distinguished (``least_margin``) from the next best one for another part of the
    #: residual is not given where it leaves more than this share of the excess over the noise floor: then
    #: something else is there, and what fits best only resembles it. The share is that of an earlier trial
    #: on other data. What is in validation logs only must leave no more of their excess over the fitted
    #: logs.
    max_unexplained: float = 0.35
    #: A ripple with fewer cycles along the path than this is as good as any other smooth function of the
    #: position.
    few_cycles: float = 5.0
    #: A residual of this many times the noise floor is looked at for what it depends on, where it is
    #: coloured (``unlike``).
    above_floor: float = 1.2
    #: Below this time of motion a reader is warned that the folds are too short to tell much, names are
    #: less probable, and servos have no friction that changes with running time, s.
    least_time: float = 30.0


def rule_text(rule: Rule) -> str:
    """As the compiled part reads it."""
    return json.dumps(dataclasses.asdict(rule))
