"""Patches as a graph for ONNX: `fields.grid.kernels.trace` for all rays at once, cell after cell, in float64.

Three modules, each recorded by itself: rays enter the box, take a step, say what they met. The steps are the body of
one ONNX loop, from which rays go that have met something or left the box.
"""

import itertools
from collections.abc import Callable, Sequence

import numpy as np
import onnx
import torch
from torch import Tensor, nn

from ddf.fields import derivatives, field_outputs
from ddf.fields.field_outputs import OUTPUTS
from ddf.fields.grid import kernels, octree, patch_field
from ddf.io.onnx_graphs import DYNAMIC, Graph

_FINEST = octree.BASE << kernels.DEEPEST  # cells along a side, were all cut to the end
_KEPT = ("p", "v", "inverse", "leave")  # that steps read
_STATE = ("depth", "patch", "ray", "t", "near")  # that steps change; the last three of the rays under way alone
Recorder = Callable[[nn.Module, Sequence[str], Sequence[Tensor], Sequence[str]], onnx.ModelProto]


class _Patches(nn.Module):
    """A part of the graph with the numbers of the patches."""

    rows: Tensor
    centres: Tensor
    counts: Tensor
    cuts: Tensor
    errors: Tensor
    nears: Tensor
    nodes: Tensor
    box: Tensor

    def __init__(self, field: patch_field.PatchField) -> None:
        super().__init__()
        tree, codes = field.tree, field.tree.codes.astype(np.int64)
        last, bits = np.flatnonzero(codes & kernels.LAST), 2 + 2 * np.arange(kernels.MOST)
        nodes = np.concatenate([tree.base.reshape(-1), tree.children.reshape(-1)])
        errors = field.tolerance / 2.0 ** (codes >> kernels.FINENESS & kernels.FINEST)
        rough = np.where(codes & kernels.ROUGH, kernels.NEAR_ROUGH * tree.sides, 0)
        numbers = {
            "rows": tree.patches,
            "centres": tree.centres.astype(np.float32),
            "counts": (last[np.searchsorted(last, np.arange(len(codes)))] - np.arange(len(codes)) + 1).astype(np.int8),
            "cuts": ((codes[:, None] >> bits & 1) - (codes[:, None] >> bits + 1 & 1)).astype(np.int8),
            "errors": np.maximum(errors, kernels.ROUNDING).astype(np.float32),
            "nears": np.maximum(np.maximum(kernels.NEAR * errors, kernels.NEAREST), rough).astype(np.float32),
            "nodes": np.where(nodes == kernels.UNKNOWN, 0, nodes).astype(np.int32),
            "box": np.stack([field.lower, field.upper]),
        }
        for name, values in numbers.items():
            self.register_buffer(name, torch.from_numpy(values))
        self.levels = round(float(np.log2(2 / octree.BASE / tree.sides.min())))
        self.most = 6 * (octree.BASE << self.levels)  # steps of a ray: twice the planes of cells


class Enter(_Patches):
    """Rays to `_KEPT` and `_STATE`."""

    def forward(self, positions: Tensor, directions: Tensor) -> tuple[Tensor, ...]:
        """What steps begin with."""
        p, v = positions.double(), directions.double()
        inverse = torch.where(v == 0, torch.full_like(v, 1e300), 1 / v)
        low, high = (self.box[0].double() - p) * inverse, (self.box[1].double() - p) * inverse
        begin, leave = torch.relu(torch.minimum(low, high).amax(1)), torch.maximum(low, high).amin(1)
        ray = (begin <= leave).nonzero().reshape(-1)
        depth, patch = torch.full_like(begin, torch.inf), torch.zeros_like(begin).long()
        return p, v, inverse, leave, depth, patch, ray, begin[ray], torch.zeros_like(begin[ray])


class Step(_Patches):
    """One cell further: `_KEPT` and `_STATE` to `_STATE`."""

    def forward(self, *given: Tensor) -> tuple[Tensor, ...]:
        """The state after the cell that each ray is in."""
        p, v, inverse, leave, depth, patch, ray, t, near = given
        q, w, last = p[ray], v[ray], leave[ray]
        c = torch.floor(torch.relu((q + (t + kernels.STEP)[:, None] * w + 1) * (_FINEST / 2))).clamp(max=_FINEST - 1)
        size = torch.full_like(t, _FINEST / octree.BASE)  # of the cell, in the smallest
        places = torch.floor(c / size[:, None])
        node = self.nodes[((places[:, 0] * octree.BASE + places[:, 1]) * octree.BASE + places[:, 2]).long()].long()
        for level in range(self.levels):
            half = _FINEST / octree.BASE / 2 ** (level + 1)
            x, y, z = (torch.floor(c / half) - 2 * torch.floor(c / (2 * half))).unbind(1)
            inner = node < 0
            child = octree.BASE**3 - 8 * (node + 1) + (4 * x + 2 * y + z).long()
            node = torch.where(inner, self.nodes[child * inner].long(), node)
            size = torch.where(inner, torch.full_like(size, half), size)
        side = size * (2 / _FINEST)
        ahead = torch.floor(c / size[:, None]) + (w >= 0).double()
        end = torch.minimum(last, ((ahead * side[:, None] - 1 - q) * inverse[ray]).amin(1))
        full = (node > 0).nonzero().reshape(-1)
        first, here, wide = node[full] - 1, t[full], side[full]
        close = torch.where(here <= wide, torch.maximum(near[full], self.nears[first].double()), torch.zeros_like(here))
        found, which = self._cell(q[full] - self.centres[first], w[full], first, here, end[full], wide, close)
        depth, patch = depth.scatter(0, ray[full], found), patch.scatter(0, ray[full], which)
        near, t = near.scatter(0, full, close), torch.maximum(end, t) + kernels.STEP
        alive = ((t <= last) & torch.isinf(depth[ray])).nonzero().reshape(-1)
        return depth, patch, ray[alive], t[alive], near[alive]

    def _cell(
        self, x: Tensor, v: Tensor, first: Tensor, begin: Tensor, end: Tensor, side: Tensor, near: Tensor
    ) -> tuple[Tensor, Tensor]:
        """The first hit in a leaf of each ray, and its patch: `_cell_hit` of the kernel."""
        slots = torch.arange(kernels.MOST)
        there = slots < self.counts[first].long()[:, None]
        ids = first[:, None] + slots * there
        row = self.rows[ids].double()
        normal, offset, a, b, c = row[..., :3], row[..., 3], row[..., 4], row[..., 5], row[..., 6]
        one, two = derivatives.tangent_basis(normal)
        u, w = (one * x[:, None]).sum(-1), (two * x[:, None]).sum(-1)
        vu, vw = (one * v[:, None]).sum(-1), (two * v[:, None]).sum(-1)
        q0 = (normal * x[:, None]).sum(-1) - offset - 0.5 * (a * u * u + 2 * b * u * w + c * w * w)
        q1 = (normal * v[:, None]).sum(-1) - a * u * vu - b * (u * vw + w * vu) - c * w * vw
        q2 = -0.5 * (a * vu * vu + 2 * b * vu * vw + c * vw * vw)
        never, square = torch.full_like(q0, torch.inf), q1 * q1 - 4 * q2 * q0
        root, flat, none = torch.sqrt(torch.relu(square)), q2 == 0, square < 0
        half = -0.5 * (q1 + torch.where(q1 >= 0, root, -root))
        r = torch.where(flat, torch.where(q1 == 0, never, -q0 / q1), torch.where(none, never, half / q2))
        s = torch.where(flat | none | (half == 0), never, q0 / half)
        roots = torch.cat([torch.minimum(r, s), torch.maximum(r, s)], 1)
        on = (begin <= side)[:, None] & (q0.abs() <= near[:, None])  # the ray starts there
        own = _twice(on) & (roots.abs() <= _twice(torch.minimum(r.abs(), s.abs())))
        error, begin, end, side = (each[:, None] for each in (self.errors[first].double(), begin, end, side))
        steep = (2 * _twice(q2) * roots + _twice(q1)).abs().clamp(min=1e-12)
        slack = torch.minimum(error / steep, 0.5 * side)
        held = _twice(there) & (roots >= 0) & (roots < torch.inf) & ~own
        held = held & (roots >= begin - slack) & (roots <= end + slack)
        y = x[:, None] + torch.where(held, roots, torch.zeros_like(roots))[..., None] * v[:, None]
        u, w = y @ one.transpose(1, 2), y @ two.transpose(1, 2)
        bent = 0.5 * (a[:, None] * u * u + 2 * b[:, None] * u * w + c[:, None] * w * w)
        f = y @ normal.transpose(1, 2) - offset[:, None] - bent
        held = held & (f * _twice(self.cuts[ids].double()) >= -error[..., None]).all(2)
        best, slot = torch.where(held, roots, torch.full_like(roots, torch.inf)).min(1)
        return best, first + slot % kernels.MOST


def _twice(values: Tensor) -> Tensor:
    """Of the lesser and of the greater roots."""
    return torch.cat([values, values], 1)


class Finish(_Patches):
    """What was met to the named outputs, 0 on a miss: `_surface` of the kernel."""

    def __init__(self, field: patch_field.PatchField, outputs: Sequence[str]) -> None:
        super().__init__(field)
        self.outputs = outputs

    def forward(self, p: Tensor, v: Tensor, depth: Tensor, patch: Tensor) -> tuple[Tensor, ...]:
        """The outputs in order, float32."""
        seen = torch.isfinite(depth)
        depth, row = torch.where(seen, depth, torch.zeros_like(depth)), self.rows[patch].double()
        one, two = derivatives.tangent_basis(row[:, :3])
        x = p + depth[:, None] * v - self.centres[patch]
        u, w, a, b, c = (one * x).sum(1), (two * x).sum(1), row[:, 4], row[:, 5], row[:, 6]
        g, h = a * u + b * w, b * u + c * w
        square = 1 + g * g + h * h
        normal = row[:, :3] - g[:, None] * one - h[:, None] * two
        sign = torch.where((normal * v).sum(1) > 0, -seen.double(), seen.double())
        found = {
            "visibility": seen,
            "depth": depth,
            "normals": (sign / torch.sqrt(square))[:, None] * normal,
            "mean_curvature": sign
            * ((1 + h * h) * a - 2 * g * h * b + (1 + g * g) * c)
            / (square * torch.sqrt(square)),
            "gaussian_curvature": seen * (a * c - b * b) / (square * square),
        }
        return tuple(found[name].float() for name in self.outputs)


class PatchGraph(Graph):
    """A field of patches: positions and directions to chosen outputs or to all, 0 on a miss."""

    def __init__(self, field: patch_field.PatchField, outputs: Sequence[str] | None) -> None:
        super().__init__()
        names = field_outputs.require(outputs or field.outputs, field.outputs)
        self.inputs = {"positions": (DYNAMIC, 3), "directions": (DYNAMIC, 3)}
        self.what = "directed distance field of one shape, of patches: oriented points to visibility, depth and more"
        self.meanings = {name: OUTPUTS[name].meaning for name in names}
        self.tolerances = {name: OUTPUTS[name].tolerance for name in names}
        self.relative = frozenset(name for name in names if OUTPUTS[name].relative)
        self.enter, self.step, self.finish = Enter(field), Step(field), Finish(field, names)

    def forward(self, positions: Tensor, directions: Tensor) -> tuple[Tensor, ...]:
        """The outputs in order."""
        p, v, inverse, leave, *state = self.enter(positions, directions)
        while len(state[2]):
            state = self.step(p, v, inverse, leave, *state)
        return self.finish(p, v, state[0], state[1])

    def assemble(self, record: Recorder) -> onnx.ModelProto:
        """The ONNX model: the three parts as `record` makes them, the second in a loop."""
        helper, kinds = onnx.helper, onnx.TensorProto
        rays = torch.tensor([[0.1, 0.2, -1.5], [0.3, -0.1, -1.5]]), torch.tensor([[0.0, 0.0, 1.0], [0.0, 0.6, 0.8]])
        given = self.enter(*rays)
        began, done = ([f"{name}_{when}" for name in _STATE] for when in ("began", "done"))
        after = [f"{name}_after" for name in _STATE]
        enter = record(self.enter, list(self.inputs), rays, [*_KEPT, *began])
        step = record(self.step, [*_KEPT, *_STATE], given, after)
        finish = record(self.finish, ["p", "v", *done[:2]], (*given[:2], *given[4:6]), list(self.meanings))
        for name, part in (("enter/", enter), ("step/", step), ("finish/", finish)):
            shared = {"rename_inputs": False, "rename_outputs": False, "rename_initializers": False}
            onnx.compose.add_prefix(part, name, inplace=True, **shared)
        changing = [helper.make_tensor_value_info(name, *_kind(name)) for name in _STATE]
        onward = [
            helper.make_node("Size", ["ray_after"], ["rays_left"]),
            helper.make_node("Greater", ["rays_left", "none_left"], ["more"]),
        ]
        body = helper.make_graph(
            [*step.graph.node, *onward],
            "step",
            [
                helper.make_tensor_value_info("count", kinds.INT64, []),
                helper.make_tensor_value_info("going", kinds.BOOL, []),
                *changing,
            ],
            [
                helper.make_tensor_value_info("more", kinds.BOOL, []),
                *(helper.make_tensor_value_info(f"{name}_after", *_kind(name)) for name in _STATE),
            ],
        )
        loop = helper.make_node("Loop", ["most_steps", "", *began], done, "walk", body=body)
        fixed = [
            helper.make_tensor(name, kinds.INT64, [], [value])
            for name, value in (("none_left", 0), ("most_steps", self.step.most))
        ]
        parts = itertools.chain(*(part.graph.initializer for part in (enter, step, finish)))
        known = {each.name: each for each in (*fixed, *parts)}
        nodes = [*enter.graph.node, loop, *finish.graph.node]
        whole = helper.make_graph(nodes, "field", enter.graph.input, finish.graph.output, list(known.values()))
        return helper.make_model(whole, opset_imports=enter.opset_import)


def _kind(name: str) -> tuple[int, list[str]]:
    """Type and shape of a part of the state."""
    kind = onnx.TensorProto.INT64 if name in ("patch", "ray") else onnx.TensorProto.DOUBLE
    return kind, [DYNAMIC if name in ("depth", "patch") else "under_way"]
