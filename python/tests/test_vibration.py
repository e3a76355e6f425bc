"""Vibration modes against what mechanics says of any object."""

import numpy as np
import pytest

import chladni


@pytest.fixture(scope="module")
def plate() -> tuple[chladni.Mesh, chladni.Vibration]:
    mesh = chladni.Mesh.sample("disk", 500)
    return mesh, chladni.vibration(mesh, k=24, thickness=0.02, young=70.0, poisson=0.3, density=2.5)


def test_frequencies_scale_as_the_material_says(plate):
    mesh, modes = plate
    assert len(modes) == 24 and modes.rigid == 6 and (modes.values[:6] == 0).all() and (np.diff(modes.values) >= 0).all()
    stiffer = chladni.vibration(mesh, k=24, thickness=0.02, young=4 * 70.0, poisson=0.3, density=2.5)
    assert np.allclose(stiffer.frequencies, 2 * modes.frequencies, rtol=1e-3)
    heavier = chladni.vibration(mesh, k=24, thickness=0.02, young=70.0, poisson=0.3, density=4 * 2.5)
    assert np.allclose(heavier.frequencies, modes.frequencies / 2, rtol=1e-3)
    # Of a plate the modes that bend it are as much faster as it is thicker; those in its plane are not among the first.
    thicker = chladni.vibration(mesh, k=12, thickness=0.022, young=70.0, poisson=0.3, density=2.5)
    assert np.allclose(thicker.frequencies[6:12], 1.1 * modes.frequencies[6:12], rtol=2e-3)


def test_a_push_moves_the_centre_of_mass_and_adds_up(plate):
    mesh, modes = plate
    corners = mesh.vertices[mesh.faces]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    masses = 2.5 * 0.02 * np.bincount(mesh.faces.ravel(), np.repeat(areas / 3, 3), len(mesh.vertices))
    push = lambda vertex, momentum: [{"impulse": {"vertex": vertex, "momentum": momentum}}]  # noqa: E731
    times = [0.0, 0.5, 2.0]
    first, second = (modes.simulate(times, push(*load)) for load in [(3, [0, 0, 0.01]), (77, [0.02, 0, 0])])
    assert first.shape == (3, len(mesh.vertices), 3) and first.dtype == np.float32 and abs(first[0]).max() < 1e-7
    centre = np.einsum("v,tvk->tk", masses, first)
    assert np.allclose(centre, np.outer(times, [0, 0, 0.01]), atol=1e-5)
    both = modes.simulate(times, push(3, [0, 0, 0.01]) + push(77, [0.02, 0, 0]))
    assert np.allclose(both, first + second, atol=1e-5)
    some = modes.simulate(times, push(3, [0, 0, 0.01]), vertices=[9, 3])
    assert np.array_equal(some, first[:, [9, 3]])


def test_what_is_clamped_stays_and_vertices_keep_their_numbers(plate):
    mesh, _ = plate
    vertices = np.concatenate([[[9.0, 9, 9]], mesh.vertices])
    rim = 1 + np.flatnonzero(np.linalg.norm(mesh.vertices, axis=1) > 0.999 * np.linalg.norm(mesh.vertices, axis=1).max())
    held = chladni.vibration(vertices, mesh.faces + 1, k=8, thickness=0.02, young=70.0, poisson=0.3, density=2.5, clamped=rim)
    assert held.rigid == 0 and held.frequencies[0] > 0
    middle = 1 + int(np.argmin(np.linalg.norm(mesh.vertices, axis=1)))
    frame = held.simulate([0.1], [{"impulse": {"vertex": middle, "momentum": [0, 0, 0.01]}}])[0]
    assert frame.shape == (len(vertices), 3) and not frame[rim].any() and abs(frame[middle, 2]) > 0


def test_the_loudest_tone_is_one_of_the_modes(plate):
    _, modes = plate
    wave = modes.sound([{"impulse": {"vertex": 0, "momentum": [0, 0, 0.01]}}], [0, 0, 5], seconds=4.0, sample_rate=8000)
    spectrum = abs(np.fft.rfft(wave))
    loudest = np.fft.rfftfreq(len(wave), 1 / 8000)[spectrum.argmax()]
    assert wave.shape == (32000,) and abs(modes.frequencies - loudest).min() < 0.3


def test_refusals_name_what_does_not_fit(plate):
    mesh, modes = plate
    with pytest.raises(chladni.ParameterError, match="vertex 99999"):
        modes.simulate([0.1], [{"impulse": {"vertex": 99999, "momentum": [0, 0, 1]}}])
    with pytest.raises(chladni.ParameterError, match="times"):
        modes.simulate([0.2, 0.1], [])
    with pytest.raises(chladni.Error):
        chladni.vibration(mesh, k=8, young=70.0, poisson=0.3, density=2.5)
    for clamped in (np.arange(mesh.vertices.shape[0]) < 5, [0.5, 1.7], [-1]):
        with pytest.raises(chladni.ParameterError, match="clamped"):
            chladni.vibration(mesh, k=8, thickness=0.02, young=70.0, poisson=0.3, density=2.5, clamped=clamped)
