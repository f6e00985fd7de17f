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
    #: names by an experiment. A candidate must exceed all but this share of its time-shift surrogates.
    family_wise: float = 0.01
    #: The held-out squared error must fall by this share on average over folds: 1 % of the rms, below which
    #: no user would notice. A signal that explains less of a residual's variance is not reported.
    least_gain: float = 0.02
    #: … and it must fall at all in this share of the folds: four of five.
    folds_that_must_gain: float = 0.8
    #: No fold may lose more than this share of its squared error.
    worst_fold: float = -0.05
    #: What lowers the squared error of its joints by this share, on the validation set and the other way
    #: round, needs no folds: a tenth of the rms. What position servos lack on all logs needs no
    #: significance where it lowers that of the validation set by this share: few seconds of it are too few
    #: blocks.
    large_gain: float = 0.19
    #: … where either way adds the same: their correlation.
    least_correlation: float = 0.5
    #: The zeros of torque sensors are in the model from the start where this many joints gain
    #: ``large_gain`` by them, both ways round: one joint alone is an effect like any other.
    joints_with_zeros: int = 2
    #: Blocks that count as independent last this many autocorrelation times of what is left …
    block_memories: float = 3.0
    #: … but not less, s …
    shortest_block: float = 0.5
    #: … and not more, s.
    longest_block: float = 2.0
    #: Share of its time-shift surrogates whose score an event of some seconds must exceed: shifted in time
    #: it falls onto others of its kind for at most a quarter of a log.
    event_surrogate_level: float = 0.75
    #: Surrogates of a step, and those that state the false-positive rate.
    surrogates: int = 2000
    #: Surrogates for which a search is done again: an effect's for logs and times, that for ripple above
    #: the band.
    searched_surrogates: int = 200
    #: A shifted column that still correlates so much with the unshifted one (a periodic motion) is no
    #: surrogate.
    surrogate_correlation: float = 0.4
    #: A term of the class of an accepted one, on the same joint, that gains less than this share of it
    #: corrects that one's law and is no effect of its own.
    only_corrects_class: float = 0.15
    #: That share for a term of another class: laws are wrong by a few percent, and that shows in any guise.
    only_corrects_any: float = 0.05
    #: Two events this close count as one whose time is a little off, s.
    same_event: float = 2.0
    #: A group with fewer columns is preferred where the better one's score is larger by less than this
    #: share or ``as_good_score``: these data do not tell the two apart.
    as_good: float = 0.02
    #: See ``as_good``: a likelihood ratio of 4.
    as_good_score: float = 3.0
    #: Two names whose gains differ by less than this factor cannot be distinguished by these data.
    least_margin: float = 1.1
    #: Two names of which one explains this share of what the other does are words for the same part of a
    #: residual. Names for the same thing share 98 % and more of it, names for different things less than 70
    #: % (noise-free trials on other data).
    same_part: float = 0.9
    #: A name that is not distinguished (``least_margin``) from the next best one for another part
    #: (``same_part``) is not given where it leaves more than this share of the excess over the noise floor:
    #: then something else is there, and what fits best only resembles it. The share is that of an earlier
    #: trial on other data. What is in validation logs only must leave no more of their excess over the
    #: fitted logs.
    max_unexplained: float = 0.35
    #: What is more than this share is most of a thing: half. An event of some seconds (a push) must explain
    #: most of what its time has more of squared error than others; another log has the same push where it
    #: has it for most of its time; an effect most of which is missing in some octave, by more than
    #: ``missing_errors``, is not the effect that it is called.
    most: float = 0.5
    #: See ``most``: standard errors that chance exceeds once in 800, ``family_wise`` over eight octaves.
    missing_errors: float = 3.2
    #: A change of the held-out squared error by this share, 5 % of the rms, is clear. A name is taken back
    #: where without its effect that error is smaller on its joints, or by this share on all together; what
    #: is in validation logs only must not raise that of any joint by it; and on repeats of one path, where
    #: whoever has more parameters fits the error that is the same in all of them, the per-joint fit is
    #: taken only where it lowers it by more.
    clear_change: float = 0.1
    #: Two recordings are one path where their positions over time correlate more than this: a path that
    #: drifts with warmth keeps its shape, and two different paths hardly correlate.
    same_path: float = 0.9
    #: A ripple with fewer cycles along the path than this is as good as any other smooth function of the
    #: position.
    few_cycles: float = 5.0
    #: Two runs start at the same place where every joint does to this share of its travel in all logs.
    same_start: float = 0.05
    #: A validation log whose squared error is this many times that of the fitted logs holds something that
    #: they do not. For position servos a mass or a gain is looked for in such a log; where none takes away
    #: most of its squared error, it is unlike the others from that ratio of the rms on.
    odd_log: float = 2.0
    #: A log has the same push if that also explains this share of the force's own torque: a push of another
    #: size or direction is another one.
    same_force: float = 0.8
    #: A residual of this many times the noise floor is looked at for what it depends on …
    above_floor: float = 1.2
    #: … where the variance of its slow means exceeds that of white noise by this factor.
    coloured: float = 2.0
    #: A joint is predicted where no more than this share of its torque's rms is left on the validation set.
    #: Where more than 1 less this share is left, a model predicts next to nothing.
    predicted_share: float = 0.1
    #: What is left of a joint below this share of its torque needs no name, whatever it depends on: a law
    #: that is missing often leaves less than ``predicted_share``.
    little_share: float = 0.05
    #: Below this time of motion a reader is warned that the folds are too short to tell much, and servos
    #: have no friction that changes with running time, s.
    least_time: float = 30.0
    #: A share of accepted surrogates above this is no chance: the residuals are not what the tests take
    #: them for, and a reader is warned.
    many_accepted: float = 0.05
    #: Two names whose models differ by less than this share of what either explains say the same.
    same_model: float = 0.1


def rule_text(rule: Rule) -> str:
    """As the compiled part reads it."""
    return json.dumps(dataclasses.asdict(rule))
