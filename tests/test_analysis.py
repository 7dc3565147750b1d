"""Analyses against closed solutions and conservation laws."""

import math
from dataclasses import replace

import numpy as np
import pytest

from granswim_pymunk.analysis.contacts import (
    ContactFinder,
    contact_directions,
    find_contacts,
    mean_direction,
    touching_pairs,
)
from granswim_pymunk.analysis.fields import Grid, coarse_grain, inertial_number, shear_rate
from granswim_pymunk.analysis.network import contact_network
from granswim_pymunk.analysis.resonance import (
    chain_frequencies,
    linearised_modes,
    resonance_table,
    resonant,
    second_resonance,
)
from granswim_pymunk.analysis.shape import comoving_shapes, segment_response
from granswim_pymunk.analysis.speed import block_error, mean_error, recording_speed, swimming_speed
from granswim_pymunk.analysis.work import power_audit, work_per_cycle
from granswim_pymunk.engine import Simulation
from granswim_pymunk.errors import InputError
from granswim_pymunk.packing import pack
from granswim_pymunk.paper import checks
from granswim_pymunk.paper.plans import FIRST
from granswim_pymunk.paper.scenes import paper_scene
from granswim_pymunk.recording import Recording
from granswim_pymunk.scene import Body, Scene, swimmer, use


@pytest.fixture(scope="module")
def bed() -> Scene:
    """A small bed with its swimmer, packed."""
    return pack(paper_scene(width=0.036, height=0.024, softness=25.0, seed=2))


# ---- resonance --------------------------------------------------------------------------------


def test_chain_of_two_masses() -> None:
    k, a, b = 3.0, 0.5, 2.0
    assert chain_frequencies(k, np.array([a, b])) == pytest.approx([math.sqrt(k * (a + b) / (a * b))], rel=1e-12)


def test_uniform_chain() -> None:
    # free chain of n equal masses: omega = 2 sqrt(k/m) sin(j pi/2n)
    n, k, m = 9, 4.0, 0.7
    exact = 2 * math.sqrt(k / m) * np.sin(np.arange(1, n) * math.pi / (2 * n))
    assert chain_frequencies(k, np.full(n, m)) == pytest.approx(exact, rel=1e-12)


def test_paper_table() -> None:
    rows = resonance_table()
    assert len(rows) == 8 and all(row.natural_agrees for row in rows)
    # every resonant value is the paper's to 0.1 %, but not all to the digit
    for row in rows:
        assert row.resonant_computed == pytest.approx(row.resonant_printed, rel=1.5e-3)
    assert {(r.label, r.mode) for r in rows if r.misprints} == {(100, 1), (150, 2), (200, 1), (200, 2)}
    assert second_resonance(100.0) == pytest.approx(9.06, abs=0.01)
    # another mass, or the printed damping, does not give the table
    assert not any(row.natural_agrees for row in resonance_table(mass=0.0142))
    assert math.isnan(resonant(1.0, 2.9))


def test_two_disks_bending() -> None:
    """One segment: force -k_B y/d on a reduced mass, damped by gamma_B."""
    k, gamma, r = 2e-3, 30.0, 1.5e-3
    scene = Scene(
        bodies=tuple(swimmer(disks=2, radius=r)),
        laws=(
            use("union", stiffness=1e3, damping=1e3),
            use("bending", stiffness=k, damping=gamma, amplitude=0.1, frequency=4.0),
        ),
    )
    masses = [b.mass for b in scene.bodies]
    reduced = masses[0] * masses[1] / sum(masses)
    omega = math.sqrt(k / (2 * r * reduced))
    modes = linearised_modes(scene)
    assert modes.natural == pytest.approx([omega / (2 * math.pi)], rel=1e-6)
    assert modes.ratio == pytest.approx([gamma / (2 * omega)], rel=1e-6)
    damped = omega * math.sqrt(1 - modes.ratio[0] ** 2) / (2 * math.pi)
    assert modes.damped == pytest.approx([damped], rel=1e-6)


@pytest.mark.parametrize(("form", "second"), [("leader", 22.0), ("elastic", 17.0), ("head_axis", 25.0)])
def test_modes_of_the_simulated_law(form: str, second: float) -> None:
    """Known for 2e-3 N per radian."""
    modes = linearised_modes(paper_scene(form=form, **FIRST))
    assert modes.natural[1] == pytest.approx(second, abs=0.6)
    stiffer = linearised_modes(paper_scene(form=form, k_B=400.0, **FIRST))
    assert stiffer.natural == pytest.approx(2 * modes.natural, rel=1e-6)


def test_modes_need_a_swimmer() -> None:
    with pytest.raises(InputError, match="no swimmer"):
        linearised_modes(Scene(bodies=(Body("a", "free", 1e-3, 1e-5, initial=(0, 0, 0, 0)),)))


# ---- speed and shape --------------------------------------------------------------------------


def travelling(speed: float, turn: float = 0.0, frequency: float = 5.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A wave-shaped swimmer that goes straight ahead at ``speed``, its heading turned by ``turn``."""
    t = np.arange(0, 2.4, 2e-3)
    mass = np.array([7.0, 1, 1, 1, 1, 1, 1])
    along = 3e-3 * np.arange(7)
    phase = 2 * np.pi * frequency * t[:, None] - 0.4 * np.arange(7)
    body = np.stack([along[None] - speed * t[:, None], 2e-4 * np.sin(phase)], axis=-1)
    c, s = math.cos(turn), math.sin(turn)
    return t, body @ np.array([[c, s], [-s, c]]), mass


@pytest.mark.parametrize("turn", [0.0, 0.7, -2.5])
def test_speed_of_a_straight_swimmer(turn: float) -> None:
    t, xy, mass = travelling(8e-3, turn)
    found = swimming_speed(t, xy, mass, 5.0)
    assert found.value == pytest.approx(8e-3, rel=2e-3)
    assert found.along_x == pytest.approx(8e-3 * math.cos(turn), rel=2e-3, abs=1e-5)
    assert found.error < 1e-4 and abs(found.turn) < 0.02
    # a swimmer that goes tail first is slower than nothing
    t, xy, mass = travelling(-3e-3, turn)
    assert swimming_speed(t, xy, mass, 5.0).value == pytest.approx(-3e-3, rel=4e-3)


def test_speed_needs_two_cycles() -> None:
    t, xy, mass = travelling(1e-3)
    with pytest.raises(InputError, match="two cycles"):
        swimming_speed(t[:300], xy[:300], mass, 5.0)


def test_block_error_covers_correlated_noise() -> None:
    """AR(1) noise: the plain error is far too small, that of blocks holds the truth about as often as it says."""
    rng = np.random.default_rng(5)
    blocks, plain = 0, 0
    for _ in range(300):
        noise = rng.normal(size=256)
        for k in range(1, 256):
            noise[k] += 0.8 * noise[k - 1]
        blocks += abs(noise.mean()) < block_error(noise)
        plain += abs(noise.mean()) < mean_error(noise)[1]
    assert plain < 0.6 * 300 and blocks > 0.9 * 300


def test_mean_error_is_students() -> None:
    mean, error = mean_error(np.array([1.0, 2.0, 3.0, np.nan]))
    assert (mean, error) == (pytest.approx(2.0), pytest.approx(4.302653 / math.sqrt(3), rel=1e-6))
    assert np.isnan(mean_error(np.array([1.0]))[1])


def test_speed_of_a_recording() -> None:
    t, xy, _ = travelling(8e-3)
    scene = Scene(
        bodies=tuple(swimmer()), periodic_x=0.02,
        laws=(use("bending", stiffness=1e-3, amplitude=0.1, frequency=5.0),),
    )  # fmt: skip
    wrapped = xy.copy()
    wrapped[..., 0] %= 0.02
    wrapped[10:14, 3] = np.nan
    recording = Recording("swim", scene, t, tuple(scene.ids), wrapped)
    # a chain longer than the period is followed disk by disk; its heading is that of the unwrapped tracks
    assert recording_speed(recording).along_x == pytest.approx(8e-3, rel=5e-3)


def test_response_of_the_segments() -> None:
    t = np.arange(0, 1.0, 1e-3)
    amplitude, lag = np.array([0.5, 0.4, 0.2]), np.array([0.1, 1.0, 4.0])
    angle = amplitude * np.sin(2 * np.pi * 6 * t[:, None] - lag) + 0.3 + 0.1 * t[:, None]
    steps = 3e-3 * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    xy = np.concatenate([np.zeros((len(t), 1, 2)), np.cumsum(steps, axis=1)], axis=1)
    found = segment_response(t, xy, np.ones(4), 6.0)
    assert found.amplitude == pytest.approx(amplitude, rel=1e-6)
    assert found.lag == pytest.approx(lag, rel=1e-6)


def test_comoving_shapes_stay() -> None:
    t, xy, mass = travelling(8e-3, turn=0.9)
    shapes = comoving_shapes(t, xy, mass, 5.0, cycles=2, count=9)
    assert np.einsum("sna,n->sa", shapes, mass) == pytest.approx(np.zeros((9, 2)), abs=1e-12)
    assert shapes[0] == pytest.approx(shapes[-1], abs=2e-5)  # a whole number of cycles apart
    assert (shapes[:, 0, 0] < shapes[:, -1, 0]).all()  # head at -x
    with pytest.raises(InputError, match="shorter"):
        comoving_shapes(t, xy, mass, 0.1)


# ---- contacts and network ---------------------------------------------------------------------


def test_contacts_are_the_engines(bed: Scene) -> None:
    sim = Simulation(bed)
    sim.advance(3000)
    state, there = sim.state(), sim.contacts()
    here = find_contacts(bed, state.xy, state.v, state.t)
    touching = there.overlap > 0
    order = np.lexsort((there.j[touching], there.i[touching]))
    assert len(here.i) > 100
    for name in ("i", "j", "normal", "force", "overlap"):
        assert getattr(here, name) == pytest.approx(getattr(there, name)[touching][order], rel=1e-9, abs=1e-15)


def test_contacts_of_another_law() -> None:
    bodies = tuple(Body(n, "free", 1e-3, 1e-5, initial=(x, 0, 0, 0)) for n, x in (("a", 0), ("b", 1.9e-3)))
    scene = Scene(bodies=bodies, laws=(use("contact_hertz", stiffness=1e6),))
    found = find_contacts(scene, np.array([[0, 0], [1.9e-3, 0]]), np.zeros((2, 2)))
    assert found.force == pytest.approx([1e6 * 1e-4**1.5], rel=1e-6)
    with pytest.raises(InputError, match="shape"):
        ContactFinder(scene)(np.zeros((3, 2)), np.zeros((3, 2)))


def test_pairs_across_the_seam() -> None:
    xy = np.array([[1e-4, 0.0], [9.9e-3, 0.0], [5e-3, 0.0]])
    i, j, branch = touching_pairs(xy, np.full(3, 5e-4), period=0.01)
    assert (i.tolist(), j.tolist()) == ([0], [1])
    assert branch[0] == pytest.approx([-2e-4, 0.0], abs=1e-15)


def test_directions_of_pushes() -> None:
    """A disk pushed from the right, from below and from the upper left."""
    places = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, -1.0], [-math.sqrt(0.5), math.sqrt(0.5)]]) * 1.8e-3
    bodies = tuple(Body(f"b{k}", "free", 1e-3, 1e-5, initial=(*p, 0, 0)) for k, p in enumerate(places))
    scene = Scene(bodies=bodies, laws=(use("contact_linear", stiffness=1e3),))
    found = contact_directions(find_contacts(scene, places, np.zeros_like(places)), [0], bins=8, axis=0.01)
    middle = 0.5 * (found.edges[1:] + found.edges[:-1])
    pushed = middle[found.count[0] > 0]
    assert found.count.sum() == 3 and found.force.sum() == pytest.approx(3 * 1e3 * 2e-4)
    # towards -x, +y, and the lower right, each in the bin that holds it
    for wanted in (math.pi - 0.01, math.pi / 2 - 0.01, -math.pi / 4 - 0.01):
        assert np.abs(pushed - wanted).min() <= math.pi / 8
    assert np.hypot(*mean_direction(found.edges, np.eye(8)[2])) == pytest.approx(1.0)


def test_hexagonal_network_is_isotropic() -> None:
    rows = 8
    x = np.array([[i + 0.5 * (j % 2), j * math.sqrt(0.75)] for j in range(rows) for i in range(rows)]) * 2e-3
    i, j, branch = touching_pairs(x, np.full(len(x), 1.0001e-3), period=2e-3 * rows)
    inner = np.arange(rows, len(x) - rows)  # without the two rows at the ends
    found = contact_network(i, j, branch, inner)
    assert found.coordination == pytest.approx(6.0) and found.floaters == 0.0
    # the ends are weighed once where they meet a row that counts
    middle = contact_network(i, j, branch, np.arange(3 * rows, 4 * rows))
    assert middle.anisotropy == pytest.approx(0.0, abs=1e-9)
    chain = contact_network(np.array([0, 1]), np.array([1, 2]), np.array([[1e-3, 0.0]] * 2), np.arange(3))
    assert (chain.coordination, chain.anisotropy) == (pytest.approx(4 / 3), pytest.approx(1.0))
    assert chain.direction == pytest.approx(0.0) and chain.branch_trace == pytest.approx(2e-6)


# ---- fields -----------------------------------------------------------------------------------


def grains_of(scene: Scene) -> np.ndarray:
    return np.array([k for k, b in enumerate(scene.bodies) if b.role == "grain"])


def test_fields_conserve(bed: Scene) -> None:
    """Mass, momentum, area and sum of r F, over a grid that holds all of it; solid fraction to 1 %."""
    sim = Simulation(bed)
    sim.advance(3000)
    state = sim.state()
    mass, radius = np.array([b.mass for b in bed.bodies]), np.array([b.radius for b in bed.bodies])
    mobile = np.array([b.mobile for b in bed.bodies])
    contacts = find_contacts(bed, state.xy, state.v)
    branch = contacts.normal * (radius[contacts.i] + radius[contacts.j] - contacts.overlap)[:, None]
    force = contacts.normal * contacts.force[:, None]
    width, period = 7.5e-4, bed.periodic_x
    assert period is not None and bed.bed is not None
    cells = round(period / 5e-4)
    grid = Grid(0.0, -4e-3, period / cells, cells, round((bed.bed.height + 8e-3) / 5e-4))
    found = coarse_grain(
        grid, width, state.xy[mobile], state.v[mobile], mass[mobile], radius[mobile],
        (state.xy[contacts.i], branch, force), period,
    )  # fmt: skip
    cell = grid.spacing**2
    assert found.density.sum() * cell == pytest.approx(mass[mobile].sum(), rel=1e-3)
    momentum = (mass[mobile, None] * state.v[mobile]).sum(axis=0)
    size = (mass[mobile] * np.hypot(*state.v[mobile].T)).sum()
    assert found.momentum_x.sum() * cell == pytest.approx(momentum[0], abs=1e-3 * size)
    assert found.momentum_y.sum() * cell == pytest.approx(momentum[1], abs=1e-3 * size)
    exact = math.pi * (radius[mobile] ** 2).sum() / (period * bed.bed.height)
    assert found.fraction.sum() * cell / (period * bed.bed.height) == pytest.approx(exact, rel=1e-2)
    stress = np.einsum("ka,kb->ab", branch, force)
    assert found.contact_xx.sum() * cell == pytest.approx(stress[0, 0], rel=1e-3)
    assert found.contact_yy.sum() * cell == pytest.approx(stress[1, 1], rel=1e-3)
    # kinetic energy is that of the mean flow and of the fluctuations
    total = 0.5 * (mass[mobile, None] * state.v[mobile] ** 2).sum()
    vx, vy = found.velocity
    parts = 0.5 * found.kinetic_pressure + 0.5 * found.density * (vx**2 + vy**2)
    assert parts.sum() * cell == pytest.approx(total, rel=2e-3)


def test_kernel_of_one_body_and_one_contact() -> None:
    grid = Grid.around(0.0, 0.0, 0.02, 0.02, 1e-4)
    one = coarse_grain(
        grid, 1e-3, np.array([[1e-3, -2e-3]]), np.array([[3.0, 4.0]]), np.array([2.0]), np.array([1e-3]),
        (np.array([[0.0, 0.0]]), np.array([[3e-3, 1e-3]]), np.array([[6.0, 2.0]])),
    )  # fmt: skip
    cell = grid.spacing**2
    assert one.number.sum() * cell == pytest.approx(1.0, rel=1e-4)
    vx, vy = one.velocity
    inside = one.density > 0
    assert np.ptp(vx[inside]) < 1e-9 and vy[inside][0] == pytest.approx(4.0)
    assert np.abs(one.kinetic_pressure).max() < 1e-9 * 25 * one.density.max()  # one body does not fluctuate
    assert one.contact_xy.sum() * cell == pytest.approx(3e-3 * 2.0, rel=1e-4)
    # nothing outside the cut-off
    x, y = np.meshgrid(grid.x, grid.y)
    assert not one.number[np.hypot(x - 1e-3, y + 2e-3) > 3e-3].any()
    twice = (one + one).mean
    assert twice.snapshots == 1 and twice.number == pytest.approx(one.number)


def test_stress_of_a_compressed_bed_is_the_wall_force() -> None:
    """A bed squeezed beyond jamming and at rest: sigma_yy inside is the force on a wall per length."""
    stress, wall = checks.squeezed()
    assert wall > 0.5  # it is squeezed
    assert stress == pytest.approx(wall, rel=1e-2)


def test_shear_and_inertial_number() -> None:
    grid = Grid.around(0.0, 0.0, 0.01, 0.008, 5e-4)
    x, y = np.meshgrid(grid.x, grid.y)
    # simple shear at rate g: half of it; rotation: none; pure strain a: a
    assert shear_rate(3.0 * y, 0 * x, 5e-4) == pytest.approx(np.full(x.shape, 1.5))
    assert shear_rate(-2.0 * y, 2.0 * x, 5e-4) == pytest.approx(np.zeros(x.shape), abs=1e-12)
    assert shear_rate(2.0 * x, -2.0 * y, 5e-4) == pytest.approx(np.full(x.shape, 2.0))
    number = inertial_number(np.array([1.0, 1.0]), np.array([10.0, 0.0]), 1e-3, 1000.0, depth=1e-3)
    assert number[0] == pytest.approx(1e-3 / math.sqrt(1e4 / 1e3)) and np.isnan(number[1])


# ---- work -------------------------------------------------------------------------------------


def test_work_of_the_centre_is_a_difference() -> None:
    """F.v/|v| over a cycle is the change of M|V|, F.v that of the kinetic energy."""
    rng = np.random.default_rng(1)
    t = np.arange(0, 1.0, 1e-3)
    v = np.cumsum(rng.normal(0, 1e-3, (len(t), 3, 2)), axis=0) + np.array([0.5, 0.0])
    mass = np.array([2.0, 1.0, 1.0])
    found = work_per_cycle(t, v, mass, 5.0)
    center = np.einsum("tna,n->ta", v, mass) / 4.0
    energy = 0.5 * 4.0 * (center**2).sum(axis=1)
    assert found.corrected[-1] == pytest.approx(energy[-1] - energy[-201], rel=1e-9)
    assert np.isnan(found.stated[198]) and np.isfinite(found.stated[199])
    speed = np.hypot(*center.T)
    assert found.stated[-1] == pytest.approx(4.0 * (speed[-1] - speed[-201]), rel=2e-2, abs=1e-4)
    with pytest.raises(InputError, match="shorter than one cycle"):
        work_per_cycle(t[:100], v[:100], mass, 5.0)


def test_power_audit_closes(bed: Scene) -> None:
    """Springs, dashpots, drive, union and confinement account for the kinetic energy of a swimming swimmer."""
    scene = replace(bed, laws=(*bed.laws, use("confinement", mu_eff=0.11, layers=11)))
    sim = Simulation(scene)
    sim.advance(4000)
    audit = power_audit(sim, 1500)
    assert audit.input > 0 and audit.residual < 1e-3
    assert audit.work["contact_linear dashpot"] < 0 and audit.work["confinement"] < 0
    assert set(audit.work) == {
        "contact_linear spring", "contact_linear dashpot", "union spring", "union dashpot", "bending spring",
        "bending dashpot", "confinement",
    }  # fmt: skip
    # a force that the scene's laws do not know is not hidden
    other = Simulation(scene)
    other.advance(4000)
    other.backend.scene = replace(scene, laws=tuple(item for item in scene.laws if item.name != "confinement"))
    assert power_audit(other, 300).residual > 1e-2


def test_audit_refuses_solvers() -> None:
    scene = Scene(
        bodies=(Body("a", "free", 0.01, 1.0, initial=(0.0, -1.0, 0.1, 0.0)),), gravity=(0.0, -9.81),
        laws=(use("gravity"), use("pin", anchor=(0.0, 0.0), length=1.0, bodies=["a"])),
    )  # fmt: skip
    with pytest.raises(InputError, match="law pin"):
        power_audit(Simulation(scene), 10)
