"""The joint filter as textbooks have it, with full matrices in numpy: slow, plain, and without a line of the core.

It takes from a model its rates, its readings and their slopes, and Newton's step of its implicit signals, each at one
point; all else is worked out here. Sources: Jazwinski, Stochastic Processes and Filtering Theory (1970), example 8.3,
extended Kalman filter; Bucy and Joseph (1968), the form of the covariance after a measurement; Verwer, Spee, Blom and
Hundsdorfer, SIAM J. Sci. Comput. 20 (1999) 1456, eq. 1.2, ROS2. What a lane and a sample hold: `contract/spec.py`.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.contract.spec import EngineSpec, pack, unpack
from faultbond.equations.plant import build_plant
from faultbond.equations.repeated import Repeated
from faultbond.equations.step import StepModel, build_step_model
from faultbond.model.graph import BondGraph
from faultbond.synthesis.specify import build_spec
from faultbond.types import Hold

SAYS_MUCH = 0.1  # variance of what is expected of a sensor, in that of its noise, from which a sample says much
MOST_STEPS = 200  # of Newton's method, halved ones too
SMALL = 1e-9  # step of an implicit signal after which it is solved, in its size

Fields = dict[str, FloatArray]


@dataclass(frozen=True, kw_only=True, eq=False)
class Lane:
    """One filter: joint vector z (n,), its covariance P (n, n), implicit signals, roles of the slot, log-likelihood."""

    z: FloatArray
    P: FloatArray
    implicit: FloatArray
    roles: Fields
    likelihood: float


@dataclass(frozen=True, kw_only=True, eq=False)
class DenseFilter:
    """The filter of a plant. `spec` says whether lanes have a slot; `model` has an error of every input."""

    spec: EngineSpec
    model: StepModel

    @cached_property
    def slot(self) -> "DenseFilter":
        """That of lanes with a slot."""
        return replace(self, spec=self.spec.slotted)

    def advance(self, lanes: FloatArray, samples: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Filter all lanes over a block of samples; see `Engine.advance`."""
        following = np.empty_like(lanes)
        innovations = np.empty((len(samples), 2 * len(self.spec.outputs), lanes.shape[1]))
        for k, numbers in enumerate(lanes.T):
            lane = self.lane(numbers)
            for t, sample in enumerate(samples):
                lane, innovations[t, :, k] = self.step(lane, sample)
            following[:, k] = self.numbers(lane)
        return following, innovations

    def lane(self, numbers: FloatArray) -> Lane:
        """Give a lane of its numbers, (n_numbers,)."""
        spec = self.spec
        return Lane(
            z=numbers[: spec.n_joint].copy(),
            P=unpack(spec, numbers[spec.covariance_slice]),
            implicit=numbers[spec.loop_slice].copy(),
            roles={name: numbers[place].copy() for name, place in spec.role_fields.items()},
            likelihood=float(numbers[-1]),
        )

    def numbers(self, lane: Lane) -> FloatArray:
        """Give the numbers of a lane, (n_numbers,)."""
        return np.concatenate([lane.z, pack(lane.P), lane.implicit, *lane.roles.values(), [lane.likelihood]])

    def step(self, lane: Lane, sample: FloatArray) -> tuple[Lane, FloatArray]:
        """Take one sample, (n_sample,); give the lane, and innovations with their variances, (2 n_outputs,)."""
        fields = {name: sample[place] for name, place in self.spec.sample_fields.items()}
        lane = self.predicted(lane, fields)
        y, H, implicit = self.measure(lane.z, lane.roles, fields["u"], lane.implicit)
        noise = self.noise(lane.roles, fields["scale"])
        variances = np.diag(H @ lane.P @ H.T) + noise
        innovations = np.concatenate([fields["y"] - y, variances])
        z, P, gained = self.updated(lane, fields, y, H)
        found = replace(lane, z=z, P=P, implicit=implicit, likelihood=lane.likelihood + gained)
        is_linear = self.model.measure_is_linear and not self.spec.slot
        says = max(fields["use"] * (variances / noise - 1.0))
        if is_linear or not (fields["again"][0] > 0 and says > SAYS_MUCH):
            return found, innovations
        middle, place = lane.z.copy(), slice(self.spec.parameter_slice.start, self.spec.slot_slice.stop)
        middle[place] = z[place]  # only what does not follow the noise of this sample
        y, H, implicit = self.measure(middle, lane.roles, fields["u"], implicit)
        z, P, _ = self.updated(lane, fields, y + H @ (lane.z - middle), H)
        return replace(found, z=z, P=P, implicit=implicit), innovations

    # Moving on.

    def predicted(self, lane: Lane, fields: Fields) -> Lane:
        """From the sample before to this one; an input was held at `u_before` or at `u`, or went linearly between."""
        spec, dt = self.spec, float(fields["dt"][0])
        z, F, Q = lane.z.copy(), np.eye(spec.n_joint), np.zeros(spec.n_joint)
        n_x = len(spec.states)
        early = np.array([item.hold is Hold.NEXT for item in spec.inputs], dtype=bool)
        begin = np.where(early, fields["u"], fields["u_before"])
        z[:n_x], F[:n_x], implicit = self.predict(
            lane.z, lane.roles, begin, lane.implicit, dt, fields["u"] - fields["u_before"]
        )
        Q[:n_x] = fields["gap"] ** 2
        if dt > 0.0:
            Q[:n_x] += [state.noise**2 for state in spec.states]
        for k, error in enumerate(spec.slow_errors):  # Ornstein-Uhlenbeck
            i, decay = n_x + k, np.exp(-dt / error.memory)
            z[i] *= decay
            F[i, i] = decay
            Q[i] = error.sd**2 * (1.0 - decay**2) + fields["kick"][k]
        jump = np.eye(spec.n_joint)
        if spec.slot:
            size = spec.slot_slice.start
            moves, fades = lane.roles["moves"][0] * dt, lane.roles["fades"][0]
            left = np.exp(-fades * moves)
            F[size, size + 1] = (1.0 - left) / fades if fades > 0.0 else moves
            jump = self.jump(lane, z, F[size, size + 1])
            z[size] += F[size, size + 1] * z[size + 1]
            F[size + 1, size + 1] = left
            z[size + 1] *= left
        z[spec.noise_slice] *= fields["fade"]  # 0 where it is white: every sample has its own
        F[spec.noise_slice] *= fields["fade"][:, None]
        Q[spec.noise_slice] = fields["fresh"]
        moved = np.arange(spec.n_joint) < n_x
        first, rest = (
            np.where(moved[:, None], F, np.eye(spec.n_joint)),
            np.where(moved[:, None], np.eye(spec.n_joint), F),
        )
        P = rest @ jump @ (first @ lane.P @ first.T + np.diag(Q * moved)) @ jump.T @ rest.T + np.diag(Q * ~moved)
        return replace(lane, z=z, P=0.5 * (P + P.T), implicit=implicit)

    def jump(self, lane: Lane, z: FloatArray, dt: float) -> FloatArray:
        """Let states go with the parameter of their store, which the slot moves for dt, where its content stays.

        Gives the slopes of that by z.
        """
        slopes = np.eye(self.spec.n_joint)
        size, first = self.spec.slot_slice.start, self.spec.parameter_slice.start
        for i, state in enumerate(self.spec.states):
            for index, power in state.jumps:
                acts = lane.roles["theta"][index]
                if not acts * lane.roles["keeps"][0] * dt > 0.0:
                    continue
                before = z[first + index] + acts * z[size]
                after = before + acts * dt * z[size + 1]
                moved, own = z[i] * (after / before) ** power, np.eye(len(z))
                own[i, i] = (after / before) ** power
                own[i, first + index] = power * moved * (1.0 / after - 1.0 / before)
                own[i, size] = acts * own[i, first + index]
                own[i, size + 1] = power * moved * acts * dt / after
                z[i], slopes = moved, own @ slopes
        return slopes

    def predict(
        self,
        z: FloatArray,
        roles: Fields,
        u: FloatArray,
        implicit: FloatArray,
        dt: float,
        climb: FloatArray | float = 0.0,
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Give the states after dt, their slopes by z, (n_states, n_joint), and the implicit signals.

        ROS2 in equal substeps. The slopes are those of its formulas with the matrix inside them held. Inputs with a
        linear hold gain `climb` over dt, as far as the plant obeys what is recorded: one that is stuck stays.
        What a gain multiplies is, for the slopes, the middle of that.
        """
        climb = np.array([item.linear for item in self.spec.inputs]) * climb
        v, _ = self.model_vector(z, roles, u)
        _, by_z = self.model_vector(z, roles, u + 0.5 * climb)
        n_x, h, gamma = len(self.spec.states), dt / self.model.substeps, 1.0 - 1.0 / np.sqrt(2.0)
        moved = np.eye(len(v))  # slope of the vector on its way by the vector at the start
        obeyed = roles["obeys"] + roles["input_gain"] * z[self.spec.slot_slice.start] if self.spec.slot else 1.0
        part = obeyed * climb / self.model.substeps
        for _ in range(self.model.substeps):
            implicit = self.solved(v, u, implicit)
            f, A = self.rates(v, u, implicit)
            force = gamma * A[:, len(v) - len(u) :] @ part  # the last columns are errors of the inputs
            u = u + part
            W = np.eye(n_x) - gamma * h * A[:, :n_x]
            k1, K1 = np.linalg.solve(W, f + force), np.linalg.solve(W, A @ moved)
            middle, moved_middle = v.copy(), moved.copy()
            middle[:n_x] += h * k1
            moved_middle[:n_x] += h * K1
            implicit = self.solved(middle, u, implicit)
            f, A = self.rates(middle, u, implicit)
            k2, K2 = np.linalg.solve(W, f - 2.0 * k1 - force), np.linalg.solve(W, A @ moved_middle - 2.0 * K1)
            v[:n_x] += h * (1.5 * k1 + 0.5 * k2)
            moved[:n_x] += h * (1.5 * K1 + 0.5 * K2)
        return v[:n_x], moved[:n_x] @ by_z, implicit

    # Looking.

    def measure(
        self, z: FloatArray, roles: Fields, u: FloatArray, implicit: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Give the readings, their slopes by z, (n_outputs, n_joint), and the implicit signals."""
        v, by_z = self.model_vector(z, roles, u)
        implicit = self.solved(v, u, implicit)
        y, by_v = self.asked_readings(v, u, implicit)
        plain, H = y[:, 0], by_v @ by_z
        if not self.spec.slot:
            return plain, H, implicit
        size = self.spec.slot_slice.start
        factor = roles["reads"] + roles["gain"] * z[size]
        H = factor[:, None] * H
        H[:, size] += roles["gain"] * plain + roles["bias"]
        H[:, size + 1] += roles["bias_beside"]
        return factor * plain + roles["bias"] * z[size] + roles["bias_beside"] * z[size + 1], H, implicit

    def noise(self, roles: Fields, scale: FloatArray) -> FloatArray:
        """Give the noise variance of each sensor; what a slot has to do with noise says nothing of blanked ones."""
        declared = self.spec.output_noise**2 * scale
        if not self.spec.slot:
            return declared
        return np.where(scale < self.spec.thresholds.blank_factor, declared * roles["noise"], declared)

    def updated(
        self, lane: Lane, fields: Fields, expected: FloatArray, H: FloatArray
    ) -> tuple[FloatArray, FloatArray, float]:
        """Take the sensors one after the other, linearised once; give z, P and the gain in log-likelihood."""
        spec = self.spec
        noise, bound = self.noise(lane.roles, fields["scale"]), fields["bound"][0]
        z, P, gained = lane.z.copy(), lane.P, 0.0
        for j in np.flatnonzero(fields["use"] > 0):
            h = H[j]
            S = h @ P @ h + noise[j]
            innovation = fields["y"][j] - expected[j] - h @ (z - lane.z)
            K = P @ h / S
            limit = bound * np.sqrt(S) if bound > 0 else np.inf  # Huber
            z = z + K * np.clip(innovation, -limit, limit)
            left = np.eye(spec.n_joint) - np.outer(K, h)
            P = left @ P @ left.T + noise[j] * np.outer(K, K)  # Joseph
            P = 0.5 * (P + P.T)
            usual = fields["nis"][j] if fields["nis"][j] > 0 else 1.0
            misfit = min(innovation**2 / S, spec.thresholds.bank_bound**2)
            counts = 1.0 / max(usual, fields["run"][j], 1.0)
            gained -= 0.5 * counts * (misfit + usual * np.log(S / spec.output_noise[j] ** 2) + np.log(2.0 * np.pi))
        z[spec.parameter_slice] = self.in_range(z[spec.parameter_slice])
        return z, P, gained

    # The plant as a lane sees it.

    def model_vector(self, z: FloatArray, roles: Fields, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Give the vector v of the model, [states, slow errors, factors, errors of all inputs], and its slope by z."""
        spec = self.spec
        first, last = spec.parameter_slice.start, spec.parameter_slice.stop
        by_z = np.zeros((last + len(spec.inputs), spec.n_joint))
        by_z[:last, :last] = np.eye(last)
        for k, index in enumerate(spec.noisy_inputs):
            by_z[last + index, spec.noise_slice.start + k] = 1.0
        if spec.slot:
            by_z[first:last, spec.slot_slice.start] = roles["theta"]
            by_z[last:, spec.slot_slice.start] = roles["input"] + roles["input_gain"] * u
            by_z[last:, spec.slot_slice.start + 1] = roles["input_beside"]
        v = by_z @ z
        if spec.slot:
            v[first:last] = self.in_range(v[first:last])
            v[last:] += (roles["obeys"] - 1.0) * u  # what is recorded does not act
        return v, by_z

    def in_range(self, factors: FloatArray) -> FloatArray:
        """Give factors within the range of their parameters."""
        limits = np.array([(item.lower, item.upper) for item in self.spec.parameters]).reshape(-1, 2)
        return np.clip(factors, limits[:, 0], limits[:, 1])

    def rates(self, v: FloatArray, u: FloatArray, implicit: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Give the rates of the states, and their slopes by v."""
        f, A = self.asked_rates(v, u, implicit)
        return f[:, 0], A

    def solved(self, v: FloatArray, u: FloatArray, implicit: FloatArray) -> FloatArray:
        """Solve the implicit signals by Newton's method, from where they were; a step that does not help is halved."""
        if not len(implicit):
            return implicit
        step, misfit = self.newton(v, u, implicit)
        for _ in range(MOST_STEPS):
            if np.all(np.abs(step) <= SMALL * np.abs(implicit)):  # what is left after it is in the order of its square
                return implicit + step
            then, left = self.newton(v, u, implicit + step)
            if left < misfit:
                implicit, step, misfit = implicit + step, then, left
            else:
                step = 0.5 * step
        return implicit

    def newton(self, v: FloatArray, u: FloatArray, implicit: FloatArray) -> tuple[FloatArray, float]:
        """Give Newton's step of the implicit signals, and how far they are from solving their equations."""
        step, misfit = self.asked_step(v, u, implicit)
        return step[:, 0], float(misfit[0, 0])

    # What the model is asked for at every sample.

    @cached_property
    def asked_rates(self) -> Repeated:
        """What works out `rates`."""
        return Repeated(self.model.rates)

    @cached_property
    def asked_readings(self) -> Repeated:
        """What works out the readings of `measure`."""
        return Repeated(self.model.readings)

    @cached_property
    def asked_step(self) -> Repeated:
        """What works out `newton`."""
        return Repeated(self.model.newton_step)


def dense_filter(graph: BondGraph) -> tuple[EngineSpec, DenseFilter]:
    """Give the specification of a plant, and the filter of its lanes."""
    plant = build_plant(graph)
    spec = build_spec(build_step_model(plant))
    return spec, DenseFilter(spec=spec, model=build_step_model(plant, all_inputs=True))
