"""Member of an ensemble that a `Twin` steps: ropes that meet, or a winch with tension feedback.

Its boundary conditions follow from the rope itself, or belong to several ropes, so that no other
member can share them. It gets its inputs a batch of steps at a time.
"""

from __future__ import annotations

from collections.abc import Sequence

from rope_twin.core import state as rows
from rope_twin.errors import InputError, SolverError, phrase
from rope_twin.scene.schema import WINCH, Scene
from rope_twin.scene.validation.rigging import is_joined, winch_of, winches_by_name
from rope_twin.twin.ensemble.boundary_conditions import check_commands
from rope_twin.twin.ensemble.member import Member, MemberResults, Scratch
from rope_twin.twin.motion.heave_series import HeaveSeries
from rope_twin.twin.snapshot import Snapshot
from rope_twin.twin.twin import Twin
from rope_twin.twin.winch.commands import CommandSample, schedule_samples

LEAD_NS = 1_000_000_000  # heave is given to the twin this long ahead; it takes up to 2 s


class TwinMember:
    """A member with a twin of its own."""

    def __init__(
        self,
        start: Twin,
        heave: HeaveSeries | None,
        commands: Sequence[CommandSample] | None,
    ) -> None:
        """Start as a copy of a twin in static equilibrium.

        heave: None: the ship lies still; commands: of the first winch; None: its schedule.

        Raises:
            InputError: the winch rejects a command, or the series moves a hang-off sideways, as
                ship poses do.
        """
        scene = start.scene
        check_commands(winch_of(scene, scene.ropes[0]), scene.ropes[0].length_m, commands or ())
        if heave is not None and heave.aside is not None:
            what = "the ship's poses move its hang-offs sideways, which this scene takes from a run"
            right = "give heave, or step it with `rope_twin run`"
            raise InputError(phrase("ensemble", what, right))
        self._twin = start.branch()
        self._twin.prescribe_motion()
        self._heave, self._commands = heave, commands
        self._samples = 0  # of the heave, given to the twin
        self._looks = self._slack_looks = 0
        self.failure = ""

    @property
    def scene(self) -> Scene:
        """The member's scene, with its changes."""
        return self._twin.scene

    @property
    def steps(self) -> int:
        """Number of completed steps."""
        return self._twin.steps

    @property
    def why_alone(self) -> str:
        """Reason why it is not stepped in SIMD lanes."""
        return "ropes that meet" if is_joined(self.scene) else "tension feedback of the winch"

    def kind(self) -> None:
        """Return None: no other member can be stepped with it."""

    def advance(self, steps: int, look_steps: int, scratch: Scratch) -> None:
        """Advance, and check for slack after every `look_steps` steps; the member may fail."""
        twin = self._twin
        end = twin.steps + steps
        self.failure = self._offer(twin.time_ns, end * twin.step_ns)
        if self.failure:
            return
        try:
            while twin.steps < end:
                twin.advance(min(end - twin.steps, look_steps - twin.steps % look_steps))
                if twin.steps % look_steps == 0:
                    self._looks += 1
                    self._slack_looks += self._is_slack()
        except SolverError as error:
            self.failure = str(error)

    def _offer(self, from_ns: int, to_ns: int) -> str:
        """Give the twin the inputs of a batch; return why it rejects one of the member's own."""
        faults = []
        if (series := self._heave) is not None:
            stamps, reach_ns = series.stamp_ns, to_ns + LEAD_NS + series.start_ns
            while self._samples < len(stamps) and stamps[self._samples] <= reach_ns:
                k, self._samples = self._samples, self._samples + 1
                at_ns = int(stamps[k]) - series.start_ns
                if at_ns > -LEAD_NS:
                    motion = float(series.position_m[k]), float(series.velocity_m_per_s[k])
                    faults.append(self._twin.offer_heave(at_ns, *motion))
        for name, winch in winches_by_name(self.scene).items():
            if name == WINCH and self._commands is not None:
                continue
            for sample in schedule_samples(winch, from_ns, to_ns):
                self._twin.offer_command(sample.stamp_ns, sample.command, name)
        for sample in self._commands or ():
            if from_ns <= sample.stamp_ns < to_ns:
                faults.append(self._twin.offer_command(sample.stamp_ns, sample.command))
        return next(filter(None, faults), "")

    def _is_slack(self) -> bool:
        """Return whether any rope has an element without tension."""
        twin = self._twin
        first, joined = twin.rope, twin.joined
        ropes = (first,) if joined is None else joined.system(first).ropes
        return any(
            bool(rope.work[rows.TENSION, : rope.state.counts[rows.ELEMENTS]].min() <= 0.0)
            for rope in ropes
        )

    def figures(self) -> MemberResults:
        """Return the results since the start; tensions are those of the first rope."""
        seen = self._twin.statistics()
        return MemberResults(
            steps=seen.steps,
            tension_top_max_n=seen.tension_top_max_n,
            tension_top_mean_n=seen.tension_top_mean_n,
            tension_top_min_n=seen.tension_top_min_n,
            slack_share=self._slack_looks / self._looks if self._looks else 0.0,
            unconverged_substeps=int(self._twin.rope.state.health[rows.SUBSTEPS_UNCONVERGED]),
            failure=self.failure,
        )

    def snapshot(self) -> Snapshot:
        """Return a frozen copy of the present and restart the recent extremes of tension."""
        return self._twin.snapshot()


SteppedMember = Member | TwinMember
