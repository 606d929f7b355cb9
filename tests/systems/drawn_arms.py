"""Arms to test with: drawn trees of hinges and slides, as objects and as MJCF."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from whsklearn import Arm


def drawn_body(rng):
    """Mass, centre and inertia about it, of six points."""
    points, masses = rng.normal(size=(6, 3)) * 0.2 + rng.normal(size=3) * 0.2, rng.uniform(0.1, 1.0, 6)
    centre = masses @ points / masses.sum()
    about = sum(m * (p @ p * np.eye(3) - np.outer(p, p)) for m, p in zip(masses, points - centre, strict=True))
    return masses.sum(), centre, about


def drawn_arm(n, seed, slides=0.3, branch=0.3, **fields):
    """A tree of n joints with bodies of positive density."""
    rng = np.random.default_rng(seed)
    axes = rng.normal(size=(n, 3))
    arm = Arm(
        [f"j{i}" for i in range(n)],
        [int(rng.integers(-1, i)) if i and rng.random() < branch else i - 1 for i in range(n)],
        rng.random(n) < slides,
        Rotation.random(n, rng=rng).as_matrix(),
        rng.normal(size=(n, 3)) * 0.4,
        axes / np.linalg.norm(axes, axis=1)[:, None],
        **{"gravity": rng.normal(size=3) * 5.0, **fields},
    )
    for joint in arm.joints:
        arm = arm.with_body(joint, *drawn_body(rng))
    return arm


def text(values):
    return " ".join(f"{v:.17g}" for v in np.ravel(values))


def drawn_mjcf(n, seed):
    """A tree with branches, welded bodies, two joints at one body, anchors, references, damping, springs, armature."""
    rng = np.random.default_rng(seed)

    def body(k):
        mass, centre, inertia = drawn_body(rng)
        full = [inertia[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
        joints = "".join(
            f'<joint name="j{k}{which}" type="{("hinge", "slide")[int(rng.random() < 0.3)]}" '
            f'axis="{text(rng.normal(size=3))}" '
            f'pos="{text(rng.normal(size=3) * 0.1)}" ref="{rng.normal():.17g}" damping="{rng.random():.17g}" '
            f'armature="{rng.random():.17g}" stiffness="{rng.random():.17g}" springref="{rng.normal():.17g}"/>'
            for which in range([1, 1, 2, 0][int(rng.integers(4))] if k else 1)
        )
        inner = "".join(body(c) for c in children.get(k, ()))
        return (
            f'<body name="b{k}" pos="{text(rng.normal(size=3) * 0.4)}" quat="{text(rng.normal(size=4))}">{joints}'
            f'<inertial mass="{mass:.17g}" pos="{text(centre)}" fullinertia="{text(full)}"/>{inner}</body>'
        )

    children: dict[int, list[int]] = {}
    for k in range(1, n):
        children.setdefault(int(rng.integers(max(0, k - 2), k)), []).append(k)
    return (
        '<mujoco><compiler angle="radian" autolimits="true"/>'
        f'<option gravity="{text(rng.normal(size=3) * 5.0)}"/><worldbody>{body(0)}</worldbody></mujoco>'
    )
