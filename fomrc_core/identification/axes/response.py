"""The periodic steady state of several axes, and its derivatives, line by line.

The drive is held between samples, delayed by less than a sample, and the modes are integrated exactly
(``model.axes.mode_answers``), so that what is fitted here is what the stepwise simulation does.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.pulse import beat
from fomrc_core.identification.axes.parameters import AxesParameters
from fomrc_core.identification.axes.periodic import PeriodicRecord
from fomrc_core.model.axes import ModeAnswers, mode_answers

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

_STEP = 1e-6  # relative, of the central differences of one mode's answer: exact to 1e-10 of it


@dataclass(frozen=True, eq=False)
class _Joints:
    """Motions (M, N), slopes of the forces (J, N), forces (J, K), answers to a force, paths (K, M, O), (J, K, O)."""

    motion: Array
    slope: Array
    force: ComplexArray
    answers: ModeAnswers
    paths: ComplexArray
    through: ComplexArray


@dataclass(frozen=True, eq=False)
class _ThroughJoints:
    """Derivatives of each joint's force, (K, n) each: by the modes' parameters, by input shapes, plays, own shape."""

    frequency: list[ComplexArray]
    damping: list[ComplexArray]
    delay: list[ComplexArray]
    real: list[list[ComplexArray]]
    imaginary: list[list[ComplexArray]]
    plays: list[list[ComplexArray]]
    shapes: list[ComplexArray]


def _forced(par: AxesParameters, joints: _Joints) -> ComplexArray:
    return np.asarray(joints.force.T @ par.joint)


def _passed(through: list[ComplexArray], forces: list[ComplexArray]) -> ComplexArray:
    return np.asarray(sum(path[:, None] * force for path, force in zip(through, forces, strict=True)))


class ResponseFit:
    """Spectra of the model for periodic records, and derivatives by every parameter.

    Args:
        records: what to answer; the same lines in each.
        play_spectra: of each record the plays of its inputs, and what else is linear in weights, (P, I, K).
        reference_v: level at which the modes are as they are.
        n_plays: how many of them are plays, whose weights are positive; the rest is of either sign.
    """

    def __init__(
        self,
        records: tuple[PeriodicRecord, ...],
        play_spectra: list[ComplexArray],
        reference_v: float,
        n_plays: int | None = None,
    ):
        self.records, self.play_spectra, self.reference_v = records, play_spectra, reference_v
        self.n_plays = len(play_spectra[0]) if n_plays is None else n_plays
        first = records[0]
        self.step_s = 1.0 / first.rate_hz
        self.z1 = np.exp(-1j * 2.0 * np.pi * first.frequency_hz * self.step_s)

    def change(self, parameters: AxesParameters, r: int) -> float:
        """Return q of a record's level."""
        return float((self.records[r].level_v / self.reference_v) ** parameters.exponent[0] - 1.0)

    def _at_level(self, par: AxesParameters, q: float) -> tuple[Array, Array, Array]:
        factor = 1.0 + par.softening * q + par.softening_squared * q * q
        return (
            np.exp(par.log_frequency) * np.maximum(factor, 0.1),
            np.minimum(np.exp(par.log_damping + par.damping_change * q), 0.9),
            1.0 + par.gain_change * q,
        )

    def drive(self, par: AxesParameters, r: int) -> ComplexArray:
        """Return the spectrum of what drives the modes, (I, K): the voltage and its plays."""
        return np.asarray(self.records[r].voltage + np.einsum("pi,pik->ik", par.play_weights, self.play_spectra[r]))

    def spectrum(self, par: AxesParameters, r: int) -> ComplexArray:
        """Return the displacement's spectrum of a record, (O, K)."""
        beat("spectra")
        q = self.change(par, r)
        omega, damping, gain = self._at_level(par, q)
        answers = mode_answers(self.z1, omega, damping, self.step_s, float(par.delay_s[0]))
        w, b, c = self.drive(par, r), par.input_shape, par.output_shape * gain[:, None]
        x, y = answers.plus * (w.T @ b.T), answers.minus * (w.T @ b.conj().T)
        direct = np.einsum("oi,ik->ok", par.static * (1.0 + par.static_change * q), w) * self.z1
        total = 0.5 * (x @ c + y @ c.conj()).T + direct
        if par.joint.size:
            total = total + self._of_joints(par, r, 0.5 * (x + y), (omega, damping), c)[0]
        return np.asarray(total)

    def _of_joints(
        self, par: AxesParameters, r: int, q_spectrum: ComplexArray, at: tuple[Array, Array], c: ComplexArray
    ) -> tuple[ComplexArray, _Joints]:
        """Return what joints add (O, K), and what derivatives need of them."""
        record = self.records[r]
        motion = record.time_series(q_spectrum.T)
        strain = par.joint @ motion
        force = record.spectrum_of(strain * np.abs(strain))
        answers = mode_answers(self.z1, *at, self.step_s, 0.0)
        paths = 0.5 * (answers.plus[:, :, None] * c + answers.minus[:, :, None] * c.conj())  # K, M, O
        added = np.einsum("kmo,jm,jk->ok", paths, par.joint, force)
        through = np.einsum("kmo,jm->jko", paths, par.joint)
        return np.asarray(added), _Joints(motion, 2.0 * np.abs(strain), force, answers, paths, through)

    def derivatives(self, par: AxesParameters, r: int) -> Iterator[tuple[int, ComplexArray, NDArray[np.int64]]]:
        """Yield for each output its number, derivatives (K, n) and the places of these n in the vector."""
        # Long: one derivative after another, of one response.
        beat("spectra with slopes")
        q, places = self.change(par, r), par.places()
        omega, damping, gain = self._at_level(par, q)
        w, b, c = self.drive(par, r), par.input_shape, par.output_shape
        delay = float(par.delay_s[0])
        here = mode_answers(self.z1, omega, damping, self.step_s, delay)
        slopes = self._slopes(omega, damping, delay)
        wb, wbc = w.T @ b.T, w.T @ b.conj().T
        x, y = here.plus * wb, here.minus * wbc
        dq = (q + 1.0) * np.log(self.records[r].level_v / self.reference_v)
        by_joints = None
        if par.joint.size:
            _, joints = self._of_joints(par, r, 0.5 * (x + y), (omega, damping), c * gain[:, None])
            by_joints = self._through_joints(par, r, joints, here, slopes, (w, wb, wbc))
            forced = _forced(par, joints)  # K, M: the joints' force on each mode
            late = self._slopes(omega, damping, 0.0)
        for o in range(c.shape[1]):
            co = c[:, o]
            hp, hm = here.plus * co * gain, here.minus * co.conj() * gain
            df, dz, dt = (0.5 * (s.plus * wb * co + s.minus * wbc * co.conj()) * gain for s in slopes)
            own, cross = 0.5 * (x + y), 0.5j * (x - y)
            real = [0.5 * (hp + hm) * u[:, None] for u in w]
            imaginary = [0.5j * (hp - hm) * u[:, None] for u in w]
            static = (1.0 + par.static_change[0] * q) * self.z1
            path = 0.5 * (hp @ b + hm @ b.conj()) + par.static[o] * static[:, None]  # K, I
            plays = [path * spectrum.T for spectrum in self.play_spectra[r]]
            if by_joints is not None:
                of_o = [through[:, o] for through in joints.through]
                own = own + 0.5 * (joints.answers.plus + joints.answers.minus) * forced
                cross = cross + 0.5j * (joints.answers.plus - joints.answers.minus) * forced
                second = [0.5 * (s.plus * co + s.minus * co.conj()) * gain * forced for s in late[:2]]
                df = df + second[0] + _passed(of_o, by_joints.frequency)
                dz = dz + second[1] + _passed(of_o, by_joints.damping)
                dt = dt + _passed(of_o, by_joints.delay)
                real = [a + _passed(of_o, at) for a, at in zip(real, by_joints.real, strict=True)]
                imaginary = [a + _passed(of_o, at) for a, at in zip(imaginary, by_joints.imaginary, strict=True)]
                plays = [a + _passed(of_o, at) for a, at in zip(plays, by_joints.plays, strict=True)]
            by_factor = df / (1.0 + par.softening * q + par.softening_squared * q * q)
            by_gain = 0.5 * (x * co + y * co.conj())
            if by_joints is not None:
                answers = joints.answers
                by_gain = by_gain + 0.5 * (answers.plus * co + answers.minus * co.conj()) * forced
            by_q = (par.static[o] @ w) * self.z1
            whole = by_factor @ (par.softening + 2.0 * par.softening_squared * q)
            whole = whole + dz @ par.damping_change + by_gain @ par.gain_change + by_q * par.static_change[0]
            columns = {
                "log_frequency": df,
                "log_damping": dz,
                "softening": by_factor * q,
                "softening_squared": by_factor * q * q,
                "damping_change": dz * q,
                "gain_change": by_gain * q,
                "static_change": (by_q * q)[:, None],
                "exponent": (whole * dq)[:, None],
                "delay_s": dt.sum(axis=1)[:, None],
            }
            found = [(values, places[name].ravel()) for name, values in columns.items()]
            found += [(own * gain, places["output_re"][:, o]), (cross * gain, places["output_im"][:, o])]
            found += [(values, places["input_re"][:, i]) for i, values in enumerate(real)]
            found += [(values, places["input_im"][:, i]) for i, values in enumerate(imaginary)]
            found += [((w * static).T, places["static"][o])]
            found += [(values, places["play_weights"][p]) for p, values in enumerate(plays)]
            for j in range(par.joint.shape[0]):
                assert by_joints is not None
                values = joints.paths[:, :, o] * joints.force[j][:, None]
                values = values + joints.through[j][:, o, None] * by_joints.shapes[j]
                found.append((values, places["joint"][j]))
            yield o, np.concatenate([values for values, _ in found], axis=1), np.concatenate([at for _, at in found])

    def _through_joints(
        self,
        par: AxesParameters,
        r: int,
        joints: _Joints,
        here: ModeAnswers,
        slopes: tuple[ModeAnswers, ModeAnswers, ModeAnswers],
        drives: tuple[ComplexArray, ComplexArray, ComplexArray],
    ) -> _ThroughJoints:
        """Return how each joint's force changes with what its modes' motion depends on."""
        record = self.records[r]
        w, wb, wbc = drives
        b = par.input_shape

        def force(motion: ComplexArray, shape: bool = True) -> list[ComplexArray]:
            series = record.time_series(motion.T)
            found = []
            for j, slope in enumerate(joints.slope):
                moved = series * par.joint[j][:, None] if shape else series
                found.append(record.spectrum_of(moved * slope).T)
            return found

        def force_of_plays(p: int) -> list[ComplexArray]:
            columns: list[list[ComplexArray]] = [[] for _ in range(par.joint.shape[0])]
            for i, spectrum in enumerate(self.play_spectra[r][p]):
                motion = 0.5 * (here.plus * b[:, i] + here.minus * b[:, i].conj()) * spectrum[:, None]
                strains = motion @ par.joint.T  # K, J
                for j, slope in enumerate(joints.slope):
                    columns[j].append(record.spectrum_of(record.time_series(strains[:, j]) * slope))
            return [np.stack(column, axis=1) for column in columns]

        half = [0.5 * (s.plus * wb + s.minus * wbc) for s in slopes]
        real, imaginary = 0.5 * (here.plus + here.minus), 0.5j * (here.plus - here.minus)
        return _ThroughJoints(
            force(half[0]),
            force(half[1]),
            force(half[2]),
            [force(real * u[:, None]) for u in w],
            [force(imaginary * u[:, None]) for u in w],
            [force_of_plays(p) for p in range(par.play_weights.shape[0])],
            [record.spectrum_of(joints.motion * slope).T for slope in joints.slope],
        )

    def _slopes(self, omega: Array, damping: Array, delay: float) -> tuple[ModeAnswers, ModeAnswers, ModeAnswers]:
        def between(high: ModeAnswers, low: ModeAnswers, width: float) -> ModeAnswers:
            return ModeAnswers((high.plus - low.plus) / width, (high.minus - low.minus) / width)

        def at(o: Array, d: Array, t: float) -> ModeAnswers:
            return mode_answers(self.z1, o, d, self.step_s, t)

        h, late = _STEP, _STEP * self.step_s
        return (
            between(at(omega * (1 + h), damping, delay), at(omega * (1 - h), damping, delay), 2 * h),
            between(at(omega, damping * (1 + h), delay), at(omega, damping * (1 - h), delay), 2 * h),
            between(at(omega, damping, delay + late), at(omega, damping, delay - late), 2 * late),
        )
