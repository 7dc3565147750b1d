"""What a kind of recording is for the pipeline: ``ObservationModel``, and what is handed from step to step."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

from ..scene import Scene
from .explained import Explained
from .hypothesis import Free
from .judge import Claim, Judgement, Mismatch, Remains, Weighed
from .places import Place
from .result import Progress, Table, Used
from .significance import Null


class Law(Protocol):
    """A candidate that was fitted. ``mechanism``: its name in the verdict, "unknown" for a form without one."""

    @property
    def mechanism(self) -> str: ...

    @property
    def label(self) -> str:
        """Its name with what it was chosen for: a joint, some bodies, an exponent."""
        ...


@dataclass(frozen=True)
class HeldOut:
    """How held-out data are predicted, looked at when the verdict is fixed.

    train, held : root mean square errors by model, see ``MODELS`` [m or rad], None where there are none
    outcome : "holds", "fails" or "undecided" for what was claimed, None where nothing was, or nothing is held out
    gain : half the fall of chi2, recalibrated less claimed
    claim : what is left of the claim; held-out data may take from it, and apparatus that was put right first is in it
    explained : of that, where it is not what was judged;  window [s] : that errors are of, None for whole runs
    whole : errors where the start is fitted to whole held-out recordings, by model
    unlike : they are off by more than where the claimed law is right and its numbers come from as noisy frames
    beyond : they are off by more than in every repeat of the film with the claimed law, which are few
    detail : errors with the claim, frame by frame, as the model has them
    """

    train: Mapping[str, float | None]
    held: Mapping[str, float | None]
    outcome: str | None
    gain: float | None
    claim: Claim
    explained: Explained | None = None
    window: float | None = None
    whole: Mapping[str, float | None] = field(default_factory=dict)
    unlike: bool = False
    beyond: bool = False
    detail: Any = field(default=None, repr=False, compare=False)

    def without(self) -> HeldOut:
        """Where the claim does not stand: the revised scene is the recalibrated one."""

        def of(errors: Mapping[str, float | None]) -> dict[str, float | None]:
            return {**errors, "revised": errors.get("recalibrated")}

        return replace(self, train=of(self.train), held=of(self.held), whole=of(self.whole))


@dataclass(frozen=True)
class Rival:
    """Another law, half its fall of chi2 on held-out data, and whether these data cannot tell it from what is named."""

    law: Any
    gain: float | None
    same: bool


@dataclass(frozen=True)
class Proposal:
    """A change of the experiment, the mechanisms that it separates, and the d' to expect after refitting the loser."""

    change: str
    separates: tuple[str, ...]
    d_prime: float


@dataclass(frozen=True)
class Left:
    """What the revised scene leaves: whether it passes for noise, and else what it is."""

    complete: bool
    remains: Remains | None


@dataclass(frozen=True)
class Course:
    """All that the steps of one diagnosis came to.

    places : where the recalibrated scene is off, the clearest first
    closest_gain, withdrawn_gain : on held-out data, of what came closest or was withdrawn
    """

    null: Null | None
    judged: Judgement
    held: HeldOut
    places: Sequence[Place] = ()
    left: Left = Left(True, None)
    rivals: Sequence[Rival] = ()
    closest: Sequence[tuple[Rival, float]] = ()
    proposal: Proposal | None = None


class ObservationModel(ABC):
    """How one kind of recording is held against simulations.

    The pipeline calls its methods from top to bottom, once each; where laws are alike, some again. What differs by kind
    is how far a simulation can follow: whole tracks, windows of some milliseconds, or statistics over packings. All
    numbers in SI; chi2 is in units of the expected spread, a gain a fall in chi2.

    kind : as in ``Diagnosis.kind``;  notes : what a reader should know, in order;  progress : (what is done, share)
    tail : model of a place's p where it is below what replicates can show
    """

    kind: str
    tail: str = ""
    notes: list[str]
    progress: Progress

    @abstractmethod
    def recalibrate(self) -> None:
        """Compare the scene as it is believed to be, then fit its adjustables: recalibration hides physics."""

    @abstractmethod
    def try_candidates(self) -> None:
        """Columns of each candidate, what recalibration can imitate projected out, and what each gains alone."""

    @abstractmethod
    def nulls(self) -> Null | None:
        """The same search where nothing is missing; None where there was nothing to search for."""

    @abstractmethod
    def search(self, null: Null | None) -> Claim:
        """One to three laws, each worth its price, refitted by simulation; none where chance gains as much."""

    def null_after(self, null: Null | None) -> Null | None:
        """What chance gains, once the search is over: another one where it had to begin anew."""
        return null

    @property
    @abstractmethod
    def plain(self) -> Claim:
        """The recalibrated scene."""

    @abstractmethod
    def weigh(self, claim: Claim) -> Weighed:
        """What the claim, and forms without a name in its place, explain on unseen blocks of the training part."""

    @abstractmethod
    def mismatch(self, claim: Claim) -> Mismatch:
        """Whether the scene is off by more than chance, and whether an adjustable moved."""

    def with_unseen(self, told: int, claim: Claim) -> ObservationModel | None:
        """The same with laws of what nobody sees, which are asked where no other explains; None where there is none.

        None, too, where by themselves, and beside what slows bodies down, they leave more than ``claim``.

        Of its own, with the first ``told`` notes: what is asked of it, and noted, leaves this one as it was.
        """
        return None

    def as_unseen(self, judged: Judgement) -> Judgement | None:
        """What is named with a law of what nobody sees, as a form without a name; None where there is no such law.

        That law comes first, the others are told in a note; the last note says in words what it is.
        """
        return None

    def passes(self, claim: Claim) -> bool:
        """Whether what a claim leaves of the training part is no more than noise."""
        return False

    def settle(self, judged: Judgement) -> Judgement:
        """The numbers of what is told, as they are written: intervals, runs of the scene as it is handed over."""
        return judged

    def alike(self, judged: Judgement) -> Sequence[Claim]:
        """Laws that training data cannot tell from what was claimed, one or two of them, best first."""
        return ()

    def runners_up(self, judged: Judgement) -> Iterable[Claim]:
        """Other laws that training data ask for by themselves, though less than for what was claimed, best first."""
        return ()

    def alike_in_slow_noise(self, judged: Judgement) -> Sequence[Claim]:
        """Laws beside those that only slower noise than was found, and that these data do not exclude, leaves open."""
        return ()

    def parts(self, judged: Judgement) -> Sequence[Claim]:
        """Each law of several that were claimed as a claim of its own, what training data ask for most first."""
        return ()

    def predicts_better(self, before: HeldOut, after: HeldOut) -> bool:
        """Whether one claim predicts held-out data better than another, by paired errors of blocks of frames."""
        return False

    @abstractmethod
    def hold_out(self, judged: Judgement) -> HeldOut:
        """Predict the held-out part with the naive, the recalibrated and the revised scene. First look at it."""

    def fails_predictive_check(self, judged: Judgement) -> bool:
        """Whether the recording as a whole is unlike its replicates in what no law shows, where nothing was found."""
        return False

    @abstractmethod
    def locate(self, judged: Judgement) -> Sequence[Place]:
        """Where the recalibrated scene is off."""

    @abstractmethod
    def left(self, judged: Judgement) -> Left:
        """Whether the revised scene leaves noise alone, and what else it leaves of unseen training data."""

    def with_found_numbers(self, judged: Judgement) -> Judgement:
        """Once it is known what is left: without names of which a number was not found, as all that is left may be."""
        return judged

    @abstractmethod
    def beside(self, judged: Judgement) -> Sequence[tuple[Any, bool]]:
        """Laws that do nearly as well as what was claimed or withdrawn; whether these data cannot tell them from it."""

    def refitted(self) -> Sequence[Any]:
        """Laws that were tried by simulation and gain more than chance, best first: that is told where none stands."""
        return ()

    def share(self, law: Any) -> Explained | None:
        """What one of these laws explains on unseen blocks; None where it could not be run."""
        return None

    @abstractmethod
    def gains(self, judged: Judgement, fallen: Sequence[Any], beside: Sequence[Any]) -> Mapping[str, float | None]:
        """By label half the fall of chi2 on held-out data, recalibrated less a law.

        fallen : names that were not accepted, of one set;  beside : others, each by itself
        """

    @abstractmethod
    def propose(self, judged: Judgement, rivals: Sequence[Rival]) -> Proposal | None:
        """The experiment that separates what is named from its first rival."""

    # ---- what is handed over

    @abstractmethod
    def mechanisms(self, course: Course) -> list[dict[str, Any]]:
        """Entries of ``mechanisms``, see ``mechanism_entry``."""

    @abstractmethod
    def adjusted(self) -> dict[int, Free]:
        """The adjustables, by where they lie among the numbers of a fit."""

    @abstractmethod
    def interval(self, course: Course, k: int) -> tuple[float, float | None, float | None]:
        """Value and 95 % interval of that number in the revised scene."""

    def adjustables(self, course: Course) -> dict[str, tuple[float, float | None, float | None]]:
        """Each adjustable's value and 95 % interval in the revised scene."""
        return {f.name: self.interval(course, k) for k, f in self.adjusted().items()}

    def believed(self) -> dict[str, tuple[float, float, float]]:
        """Each adjustable's value before anything was fitted, and its bounds."""
        return {f.name: (f.first, f.low, f.high) for f in self.adjusted().values()}

    def false_alarm(self, course: Course) -> float:
        """Probability that nothing is missing and the recording looks like that."""
        return 1.0 if course.null is None else course.null.p

    def instead(self, course: Course) -> tuple[str, ...]:
        """Numbers of the scene, in words, that nobody declared adjustable and that would do as well."""
        return ()

    def closing_notes(self, course: Course) -> list[str]:
        """What is said when all is known."""
        return []

    @abstractmethod
    def revised(self, course: Course) -> dict[str, Scene]:
        """For each recording the scene with what was found; it runs as it is."""

    @abstractmethod
    def used(self) -> tuple[Used, ...]:
        """How each recording was used."""

    @abstractmethod
    def evidence(self, course: Course) -> Any:
        """What figures are drawn from."""

    def tables(self, course: Course) -> tuple[Table, ...]:
        """Further tables of the report."""
        return ()

    @property
    def unit(self) -> str | None:
        """Of errors; None where they have none of the contract's."""
        return "m rms"

    @property
    def right_law(self) -> tuple[float, float] | None:
        """Smallest and largest held-out error where the law is right and its numbers come from as noisy frames."""
        return None

    @property
    def widened(self) -> float:
        """By how many times intervals are wider, because what is left is larger than the noise or remembers."""
        return 1.0

    @property
    @abstractmethod
    def runs(self) -> int:
        """How many simulations were run."""

    def done(self) -> None:
        """Forget what was kept for a diagnosis that is interrupted."""
        return
