"""The shapes of the scene as triangles: handles, rings, and a quadrotor with its arrows."""

import numpy as np
import trimesh

SIDES = 32
"""Of a ring."""
THIN = 0.1
"""Width of a ring over its radius."""


def ball() -> tuple[np.ndarray, np.ndarray]:
    """Vertices (V, 3) and faces (F, 3) of a ball of radius 1."""
    mesh = trimesh.creation.icosphere(subdivisions=2)
    return np.asarray(mesh.vertices, dtype=np.float32), np.asarray(mesh.faces, dtype=np.uint32)


def ring() -> tuple[np.ndarray, np.ndarray]:
    """A ring of radius 1 about x."""
    mesh = trimesh.creation.annulus(1.0 - THIN, 1.0, THIN, sections=SIDES)
    vertices = np.asarray(mesh.vertices)[:, [2, 0, 1]]
    return vertices.astype(np.float32), np.asarray(mesh.faces, dtype=np.uint32)


def quadrotor(rotors: np.ndarray) -> tuple[trimesh.Trimesh, float]:
    """A quadrotor, x forward, from (4, 2) places of its rotors in m; and its size, m."""
    arm = float(np.linalg.norm(rotors, axis=1).max())
    gaps = np.linalg.norm(rotors[:, None] - rotors[None], axis=-1)
    disc = 0.42 * float(gaps[gaps > 0.0].min())
    parts = [_coloured(trimesh.creation.icosphere(radius=0.32 * arm), DARK, (1.0, 1.0, 0.45))]
    for x, y in rotors:
        bar = trimesh.creation.box((float(np.hypot(x, y)), 0.1 * arm, 0.08 * arm))
        bar.apply_translation((np.hypot(x, y) / 2.0, 0.0, 0.0))
        bar.apply_transform(trimesh.transformations.rotation_matrix(np.arctan2(y, x), (0, 0, 1)))
        parts.append(_coloured(bar, DARK))
        rotor = trimesh.creation.cylinder(disc, 0.05 * arm, sections=SIDES)
        rotor.apply_translation((x, y, 0.13 * arm))
        parts.append(_coloured(rotor, FRONT if x > 0.0 else REAR))
    return trimesh.util.concatenate(parts), arm + disc


def about(directions: np.ndarray) -> np.ndarray:
    """(n, 4) turns as w, x, y, z that take x to each of (n, 3) directions, upright."""
    forward = directions / np.linalg.norm(directions, axis=-1, keepdims=True)
    yaw = np.arctan2(forward[:, 1], forward[:, 0]) / 2.0
    pitch = -np.arcsin(np.clip(forward[:, 2], -1.0, 1.0)) / 2.0
    cy, sy, cp, sp = np.cos(yaw), np.sin(yaw), np.cos(pitch), np.sin(pitch)
    return np.stack([cy * cp, -sy * sp, cy * sp, sy * cp], axis=-1)


DARK, FRONT, REAR = (45, 52, 62), (235, 94, 40), (120, 134, 150)
"""Body; rotors in front, so that one sees where the nose points; and those behind."""


def _coloured(
    mesh: trimesh.Trimesh,
    colour: tuple[int, int, int],
    stretch: tuple[float, float, float] = (1.0, 1.0, 1.0),
) -> trimesh.Trimesh:
    mesh.apply_scale(stretch)
    mesh.visual = trimesh.visual.ColorVisuals(mesh, face_colors=(*colour, 255))
    return mesh
