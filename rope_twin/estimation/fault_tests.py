"""Likelihood-ratio tests of single faults on the innovations of the top tension, sample by sample.

With innovations e (measured less predicted, before they are assimilated), their covariance S and
the signature s of a cause that begins at an onset, the generalised likelihood ratio is

    ℓ = (sᵀS⁻¹e)² / (sᵀS⁻¹s),

which has a χ² distribution of one degree without a fault (Willsky and Jones 1976, eqs. 12 to 16).
It is formed for every cause and every onset on a grid. S = L·Lᵀ grows by rows with each new sample
(it is never factored again), so whitened innovations L⁻¹e and signatures L⁻¹s are extended by
forward substitution and ℓ is two running sums. Samples before the onset have no signature but take
part: they show what the figures and the coloured error did just before, which a test of the last
seconds alone cannot know. The normalised innovation squared (NIS; Bar-Shalom, Li and Kirubarajan
2001, section 5.4) is kept for what no signature describes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import solve_triangular

from rope_twin.core.state import Floats
from rope_twin.errors import InputError, phrase

ONSET_SAMPLES = 4  # between two onsets: 1 s
FINE_ONSETS_S = 20.0  # older onsets are thinned ...
COARSE_ONSET_SAMPLES = 16  # ... to one every 4 s
LEAST_SAMPLES = 4  # of a signature before its ratio counts
LEAST_POWER = 1e-3  # of a whitened signature of unit size: nothing is seen of it yet
NIS_SPANS = 8, 16, 32, 80, 240  # samples: 2, 4, 8, 20 and 60 s


@dataclass(frozen=True)
class Signature:
    """Change of the measured tension by a cause of unit size, from its onset on.

    Exactly one of the three is given.
    """

    cause: str
    direction: Mapping[str, float] = field(default_factory=dict)  # of the figures, by column
    response: Floats | None = None  # [N] at each sample since the onset
    ramp_n_per_s: float = 0.0  # a drift
    sign: int = 0  # +1: only positive sizes are possible; 0: both


@dataclass(frozen=True)
class Suspicion:
    """Most likely onset and size of one cause."""

    cause: str
    ratio: float  # ℓ
    onset_s: float
    size: float  # in units of its signature


class GrowingWhitener:
    """Cholesky factor of a covariance to which rows are added, (capacity, capacity) at most."""

    def __init__(self, capacity: int) -> None:
        self._factor = np.zeros((capacity, capacity))
        self.count = 0

    def extend(self, cross: Floats, own: Floats) -> Floats:
        """Add m samples; return the rows of L that link them to the earlier ones, (m, count).

        cross: (m, count) covariance with the earlier samples; own: (m, m) among themselves.

        Raises:
            InputError: the covariance is not positive definite, or there is no capacity left.
        """
        n, m = self.count, len(own)
        L = self._factor
        if n + m > len(L):
            what = f"{n + m} samples do not fit into {len(L)}"
            raise InputError(phrase("fault tests", what, "restart them with a new reference"))
        link = np.zeros((m, n))
        if n:
            link = solve_triangular(L[:n, :n], cross.T, lower=True, check_finite=False).T
        try:
            L[n : n + m, n : n + m] = np.linalg.cholesky(own - link @ link.T)
        except np.linalg.LinAlgError as error:
            what = "the covariance of the innovations is not positive definite"
            raise InputError(phrase("fault tests", what, "check the noise of the load pin")) from (
                error
            )
        L[n : n + m, :n] = link
        self.count = n + m
        return link

    def whiten(self, link: Floats, new: Floats, earlier: Floats) -> Floats:
        """Return the whitened rows of the samples added last, (m, h).

        new: their values, (m, h); earlier: whitened rows of the samples before, (count - m, h).
        """
        m = len(new)
        own = self._factor[self.count - m : self.count, self.count - m : self.count]
        rest = new - link @ earlier
        return np.asarray(solve_triangular(own, rest, lower=True, check_finite=False))


class FaultTests:
    """Ratios of all causes and onsets since a reference, at which the figures were frozen."""

    def __init__(
        self,
        signatures: Sequence[Signature],
        autocovariance: Floats,
        white_n: float,
        covariance: Floats,
        names: Sequence[str],
        *,
        begin_s: float,
        interval_s: float,
    ) -> None:
        """Begin without samples.

        Args:
            signatures: one for each cause, or several.
            autocovariance: of the coloured error of the tension at lags of interval_s, (lags,)
                [N²]; its length is the most samples since the reference.
            white_n: standard deviation of the white noise of a sample [N].
            covariance: P of the figures at the reference, (figures, figures).
            names: of the figures, in the order of P.
            begin_s: time of the first sample.
            interval_s: of the samples.

        Raises:
            InputError: a signature names a figure that there is not, or gives nothing.
        """
        self.signatures = tuple(signatures)
        self._directions = np.zeros((len(self.signatures), len(names)))
        for row, one in zip(self._directions, self.signatures, strict=True):
            if (bool(one.direction) + (one.response is not None) + bool(one.ramp_n_per_s)) != 1:
                what = "it has no or more than one signature"
                right = "give a direction, a response or a ramp"
                raise InputError(phrase(one.cause, what, right))
            for name, value in one.direction.items():
                if name not in names:
                    right = f"known: {', '.join(names)}"
                    raise InputError(phrase(one.cause, f"there is no figure '{name}'", right))
                row[names.index(name)] = value
        capacity = len(autocovariance)
        self._colour, self._white, self._P = autocovariance, white_n**2, covariance
        self.begin_s, self.interval_s = begin_s, interval_s
        self._factor = GrowingWhitener(capacity)
        self._place = np.zeros(capacity, dtype=np.intp)  # number of each sample taken, in time
        self._columns = np.zeros((capacity, len(names)))
        self._innovations = np.zeros((capacity, 1))  # whitened
        self._numbers = 0  # of samples in time, missing ones too
        # hypotheses: a cause (number of its signature) with an onset (number of a sample)
        self._cause = np.zeros(0, dtype=np.intp)
        self._onset = np.zeros(0, dtype=np.intp)
        self._whitened = np.zeros((capacity, 0))
        self._product, self._power = np.zeros(0), np.zeros(0)
        self._seen = np.zeros(0, dtype=np.intp)  # samples since the onset

    def __len__(self) -> int:
        """Return the number of samples since the reference, missing ones too."""
        return self._numbers

    @property
    def capacity(self) -> int:
        """Return the largest number of samples."""
        return len(self._colour)

    @property
    def now_s(self) -> float:
        """Return the end of the newest sample."""
        return self.begin_s + self.interval_s * self._numbers

    def extend(self, residual_n: Floats, columns: Floats) -> None:
        """Take new samples, and form the ratios with them.

        residual_n: (m,), NaN: missing; columns: ∂ŷ/∂θ of each figure, (m, figures). Samples whose
        columns are not finite are missing too.

        Raises:
            InputError: more samples than the capacity, or S is not positive definite.
        """
        first, total = self._numbers, self._numbers + len(residual_n)
        if total > self.capacity:
            what = f"{total} samples do not fit into {self.capacity}"
            raise InputError(phrase("fault tests", what, "restart them with a new reference"))
        self._numbers = total
        self._begin_onsets(first, total)
        good = np.isfinite(residual_n) & np.isfinite(columns).all(axis=1)
        place, J, e = first + np.flatnonzero(good), columns[good], residual_n[good]
        if not len(e):
            return
        n, m = self._factor.count, len(e)
        before = slice(0, n)
        JP = J @ self._P
        cross = self._colour[np.abs(place[:, None] - self._place[before])]
        own = self._colour[np.abs(place[:, None] - place)] + self._white * np.eye(m) + JP @ J.T
        link = self._factor.extend(cross + JP @ self._columns[before].T, own)
        new = slice(n, n + m)
        self._place[new], self._columns[new] = place, J
        whiten = self._factor.whiten
        self._innovations[new] = whiten(link, e[:, None], self._innovations[before])
        values = self._values(place, J)
        self._whitened[new] = whiten(link, values, self._whitened[before])
        rows = self._whitened[new]
        self._product += rows.T @ self._innovations[new, 0]
        self._power += np.einsum("ij,ij->j", rows, rows)
        self._seen += (place[:, None] >= self._onset).sum(axis=0)

    def _begin_onsets(self, first: int, total: int) -> None:
        """Add hypotheses that begin within the new samples, and thin the old ones."""
        fine = round(FINE_ONSETS_S / self.interval_s)
        kept = (self._onset % COARSE_ONSET_SAMPLES == 0) | (self._onset > first - fine)
        onsets = np.arange(-(-first // ONSET_SAMPLES) * ONSET_SAMPLES, total, ONSET_SAMPLES)
        cause = np.tile(np.arange(len(self.signatures)), len(onsets))
        fresh = len(cause)
        self._cause = np.append(self._cause[kept], cause)
        self._onset = np.append(self._onset[kept], np.repeat(onsets, len(self.signatures)))
        empty = np.zeros((self.capacity, fresh))
        self._whitened = np.hstack([self._whitened[:, kept], empty])
        self._product = np.append(self._product[kept], np.zeros(fresh))
        self._power = np.append(self._power[kept], np.zeros(fresh))
        self._seen = np.append(self._seen[kept], np.zeros(fresh, dtype=np.intp))

    def _values(self, place: np.ndarray, J: Floats) -> Floats:
        """Return the signatures of all hypotheses at new samples, (m, hypotheses)."""
        values = np.zeros((len(place), len(self._onset)))
        along = J @ self._directions.T
        for number, one in enumerate(self.signatures):
            mine = self._cause == number
            since = place[:, None] - self._onset[mine]
            if one.response is not None:
                known = np.clip(since, 0, len(one.response) - 1)
                shape = one.response[known]
            elif one.ramp_n_per_s:
                shape = one.ramp_n_per_s * self.interval_s * (since + 0.5)
            else:
                shape = np.broadcast_to(along[:, number, None], since.shape)
            values[:, mine] = np.where(since >= 0, shape, 0.0)
        return values

    def ratios(self) -> Floats:
        """Return ℓ of each hypothesis; 0: too little was seen, or its size has the wrong sign."""
        ready = (self._seen >= LEAST_SAMPLES) & (self._power > LEAST_POWER)
        signs = np.array([one.sign for one in self.signatures])[self._cause]
        ready &= (signs == 0) | (np.sign(self._product) == signs)
        ratio = np.zeros(len(self._onset))
        np.divide(self._product**2, self._power, out=ratio, where=ready)
        return ratio

    def suspicions(self) -> list[Suspicion]:
        """Return each cause with its most likely onset, the most likely cause first."""
        ratio, best = self.ratios(), dict[str, Suspicion]()
        for number in np.argsort(ratio)[::-1]:
            cause = self.signatures[self._cause[number]].cause
            if cause in best or ratio[number] <= 0.0:
                continue
            onset_s = self.begin_s + self.interval_s * float(self._onset[number])
            size = float(self._product[number] / self._power[number])
            best[cause] = Suspicion(cause, float(ratio[number]), onset_s, size)
        return list(best.values())

    def nis(self) -> float:
        """Return the largest NIS of the last spans, in standard deviations of χ² above its mean."""
        e, n = self._innovations[: self._factor.count, 0], self._factor.count
        spans = [span for span in NIS_SPANS if span <= n]
        return max(
            ((float(e[n - k :] @ e[n - k :]) - k) / math.sqrt(2.0 * k) for k in spans), default=0.0
        )

    @property
    def whitened(self) -> Floats:
        """Return the whitened innovations, (samples taken,); N(0, 1) each without a fault."""
        return self._innovations[: self._factor.count, 0].copy()
