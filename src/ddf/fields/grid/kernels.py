"""Compiled loops of patch fields: rays through the octree, and the patches that fit the triangles of a cell.

A patch of a cell with centre c and side s is a unit normal n with the tangents t1, t2 of `_tangents`, and
  f(x) = z - o - (A u² + 2 B u w + C w²) / 2,  (z, u, w) = (n, t1, t2) · (x - c),
a plane where A = B = C = 0, else a paraboloid; its row is (n, o, A, B, C). A cell has up to `MOST` patches, one after
the other. The code of a patch says how the others cut it: bit 0, it is the last of its cell; bit 1, the cell is rough,
patches fit no better than its side; bits 2 + 2 j, 3 + 2 j: it holds only where f_j >= 0, where f_j <= 0; bits from
`FINENESS` on, three: how often the error of the cell can be doubled within the tolerance.

All in one file: numba keeps compiled code until the file changes, not until another does.
"""

import numpy as np

from ddf.geometry.grid_loops import compiled

MOST = 4  # patches in a cell
LAST, ROUGH, FINENESS, FINEST = 1, 2, 11, 7  # of a code
WIDTH = 7  # of a row
GRID = 6  # samples of a patch along a side of its cell
FLAT = 0.125  # of the tolerance: a plane that is so near needs no bending
MOST_BENT = 1.0  # |A| s from which on a paraboloid is no patch
_MANY = 48  # triangles of a cell from which on it is cut, not clustered
DEEPEST = 10  # how often a base cell may be cut, at most
UNKNOWN = 1 << 30  # a node: an empty cell that nobody looked into
GUESSED = 1 << 14  # of the first code of a cell, in memory: no ray ended on its patches
_LONG = 1e300  # in place of 1/0
ROUNDING = 5e-6  # of patches by their files, at most
STEP = 1e-9  # into a cell, so that its own numbers say where the ray is
NEAR, NEAR_ROUGH, NEAREST = 2.0, 0.25, 1.5e-5  # starts on a patch: in errors of a cell, in sides of a rough one


@compiled
def _tangents(x, y, z):
    """Two unit tangents of a unit normal, (3) + (3) numbers. Source: Duff et al. 2017, branchless frames."""
    sign = 1.0 if z >= 0 else -1.0
    a = -1.0 / (sign + z)
    b = x * y * a
    return 1 + sign * x * x * a, sign * b, -sign * x, b, sign + y * y * a, -y


@compiled
def _value(rows, i, x, y, z):
    """f of patch i at a point, from the cell's centre."""
    nx, ny, nz, p, q, r = rows[i, 0], rows[i, 1], rows[i, 2], rows[i, 4], rows[i, 5], rows[i, 6]
    height = nx * x + ny * y + nz * z - rows[i, 3]
    if p == 0 and q == 0 and r == 0:
        return height
    a, b, c, d, e, g = _tangents(nx, ny, nz)
    u, w = a * x + b * y + c * z, d * x + e * y + g * z
    return height - 0.5 * (p * u * u + 2 * q * u * w + r * w * w)


@compiled
def _along(rows, i, x, y, z, vx, vy, vz):
    """f(x + t v) = q2 t² + q1 t + q0 of patch i."""
    nx, ny, nz, p, q, r = rows[i, 0], rows[i, 1], rows[i, 2], rows[i, 4], rows[i, 5], rows[i, 6]
    q0, q1 = nx * x + ny * y + nz * z - rows[i, 3], nx * vx + ny * vy + nz * vz
    if p == 0 and q == 0 and r == 0:
        return 0.0, q1, q0
    a, b, c, d, e, g = _tangents(nx, ny, nz)
    u, w = a * x + b * y + c * z, d * x + e * y + g * z
    vu, vw = a * vx + b * vy + c * vz, d * vx + e * vy + g * vz
    q0 -= 0.5 * (p * u * u + 2 * q * u * w + r * w * w)
    q1 -= p * u * vu + q * (u * vw + w * vu) + r * w * vw
    return -0.5 * (p * vu * vu + 2 * q * vu * vw + r * vw * vw), q1, q0


@compiled
def _roots(q2, q1, q0):
    """Both roots, the lesser first; infinite where there is none."""
    if q2 == 0:
        return (-q0 / q1 if q1 != 0 else np.inf), np.inf
    root = q1 * q1 - 4 * q2 * q0
    if root < 0:
        return np.inf, np.inf
    half = -0.5 * (q1 + (np.sqrt(root) if q1 >= 0 else -np.sqrt(root)))
    first, second = half / q2, (q0 / half if half != 0 else np.inf)
    return min(first, second), max(first, second)


@compiled
def _error(code, tolerance):
    """Bound of the error of a cell that is not rough."""
    return tolerance / (1 << (code >> FINENESS & FINEST))


@compiled
def _nearness(code, side, tolerance):
    """How near to the patches of a cell a start lies on them: fits do not tell on which side."""
    near = max(NEAREST, NEAR * _error(code, tolerance))
    return max(near, NEAR_ROUGH * side) if code & ROUGH else near


@compiled
def _cell_hit(patches, codes, first, x, y, z, vx, vy, vz, begin, end, side, tolerance, near):
    """The first t >= 0 on a patch of a cell, and which; else `inf`.

    In [begin, end], or by the error of the cell beyond, so that neighbours leave no gap.

    A patch that the ray starts on, x = x(0), is not met where it starts. near: as far off it may lie.
    """
    best, which, count, error = np.inf, -1, 1, max(_error(codes[first], tolerance), ROUNDING)
    while codes[first + count - 1] & LAST == 0:
        count += 1
    for i in range(count):
        q2, q1, q0 = _along(patches, first + i, x, y, z, vx, vy, vz)
        near_root, far_root = _roots(q2, q1, q0)
        on = begin <= side and abs(q0) <= near
        for root in (near_root, far_root):
            if not 0 <= root < best or (on and abs(root) <= min(abs(near_root), abs(far_root))):
                continue
            slack = min(error / max(abs(2 * q2 * root + q1), 1e-12), 0.5 * side)
            if root < begin - slack or root > end + slack:
                continue
            held = True
            for j in range(count):
                cut = codes[first + i] >> (2 + 2 * j) & 3
                if cut:
                    other = _value(patches, first + j, x + root * vx, y + root * vy, z + root * vz)
                    held = held and (other if cut == 1 else -other) >= -error
            if held:
                best, which = root, first + i
    return best, which


@compiled
def _surface(rows, i, x, y, z, vx, vy, vz, out, ray):
    """Into out[ray, 1:]: unit normal that faces back, κ1 + κ2, κ1 κ2 of patch i at a point from its cell's centre."""
    a, b, c, d, e, g = _tangents(rows[i, 0], rows[i, 1], rows[i, 2])
    u, w = a * x + b * y + c * z, d * x + e * y + g * z
    p, q = rows[i, 4] * u + rows[i, 5] * w, rows[i, 5] * u + rows[i, 6] * w
    nx, ny, nz = rows[i, 0] - p * a - q * d, rows[i, 1] - p * b - q * e, rows[i, 2] - p * c - q * g
    square = 1 + p * p + q * q
    sign = -1.0 if nx * vx + ny * vy + nz * vz > 0 else 1.0
    scale = sign / np.sqrt(square)
    out[ray, 1], out[ray, 2], out[ray, 3] = scale * nx, scale * ny, scale * nz
    mean = (1 + q * q) * rows[i, 4] - 2 * p * q * rows[i, 5] + (1 + p * p) * rows[i, 6]
    out[ray, 4] = sign * mean / (square * np.sqrt(square))
    out[ray, 5] = (rows[i, 4] * rows[i, 6] - rows[i, 5] * rows[i, 5]) / (square * square)


@compiled
def trace(positions, directions, box, base, children, patches, codes, tolerance):
    """What rays meet first, (n, 8): depth (`inf` on a miss), normal, κ1 + κ2, κ1 κ2, 1 where all was seen, which patch.

    box: (2, 3), outside of which nothing is. base (R, R, R) of the cube [-1, 1]³: 0 an empty cell, k > 0 a leaf whose
    patches begin at k - 1, -k < 0 a cell whose eight parts are children[k - 1], x slowest; or `UNKNOWN`.
    """
    out = np.zeros((len(positions), 8))
    finest = base.shape[0] << DEEPEST  # cells along a side, were all cut to the end
    unit, per = 2.0 / finest, 0.5 * finest
    for ray in range(len(positions)):
        px, py, pz = positions[ray, 0], positions[ray, 1], positions[ray, 2]
        vx, vy, vz = directions[ray, 0], directions[ray, 1], directions[ray, 2]
        out[ray, 0], out[ray, 6] = np.inf, 1.0
        ix, iy, iz = (1 / vx if vx else _LONG), (1 / vy if vy else _LONG), (1 / vz if vz else _LONG)
        ax, ay, az = (box[0, 0] - px) * ix, (box[0, 1] - py) * iy, (box[0, 2] - pz) * iz
        bx, by, bz = (box[1, 0] - px) * ix, (box[1, 1] - py) * iy, (box[1, 2] - pz) * iz
        t, near = max(0.0, min(ax, bx), min(ay, by), min(az, bz)), 0.0
        leave = min(max(ax, bx), max(ay, by), max(az, bz))
        sx, sy, sz = int(vx >= 0), int(vy >= 0), int(vz >= 0)  # the side of a cell by which the ray leaves it
        while t <= leave:
            inside = t + STEP
            i = min(max(int((px + inside * vx + 1) * per), 0), finest - 1)
            j = min(max(int((py + inside * vy + 1) * per), 0), finest - 1)
            k = min(max(int((pz + inside * vz + 1) * per), 0), finest - 1)
            shift = DEEPEST
            node = base[i >> shift, j >> shift, k >> shift]
            while node < 0:
                shift -= 1
                node = children[-node - 1, (i >> shift & 1) << 2 | (j >> shift & 1) << 1 | (k >> shift & 1)]
            side = unit * (1 << shift)
            i, j, k = i >> shift, j >> shift, k >> shift
            end = min(leave, ((i + sx) * side - 1 - px) * ix)
            end = min(end, ((j + sy) * side - 1 - py) * iy, ((k + sz) * side - 1 - pz) * iz)
            if node == UNKNOWN:
                out[ray, 6] = 0.0
            elif node > 0:
                x, y, z = px + 1 - (i + 0.5) * side, py + 1 - (j + 0.5) * side, pz + 1 - (k + 0.5) * side
                near = max(near, _nearness(codes[node - 1], side, tolerance)) if t <= side else 0.0
                depth, which = _cell_hit(patches, codes, node - 1, x, y, z, vx, vy, vz, t, end, side, tolerance, near)
                if which >= 0:
                    out[ray, 0], out[ray, 7] = depth, which
                    if codes[node - 1] & GUESSED:
                        out[ray, 6] = 0.0
                    _surface(patches, which, x + depth * vx, y + depth * vy, z + depth * vz, vx, vy, vz, out, ray)
                    break
            t = max(end, t) + STEP
    return out


@compiled
def _clip(corners, triangle, lows, cell, side, polygon, spare):
    """The part of a triangle in a cell, as a polygon: its number of corners, in `polygon` (12, 3)."""
    count = 3
    for i in range(3):
        for k in range(3):
            polygon[i, k] = corners[triangle, i, k]
    for axis in range(3):
        for sign in (1.0, -1.0):
            bound = lows[cell, axis] if sign > 0 else lows[cell, axis] + side
            kept = 0
            for i in range(count):
                j = (i + 1) % count
                a, b = sign * (polygon[i, axis] - bound), sign * (polygon[j, axis] - bound)
                if a >= 0:
                    for k in range(3):
                        spare[kept, k] = polygon[i, k]
                    kept += 1
                if (a > 0 and b < 0) or (a < 0 and b > 0):
                    for k in range(3):
                        spare[kept, k] = polygon[i, k] + a / (a - b) * (polygon[j, k] - polygon[i, k])
                    spare[kept, axis] = bound
                    kept += 1
            count = kept
            for i in range(count):
                for k in range(3):
                    polygon[i, k] = spare[i, k]
    return count


@compiled
def _area(polygon, count):
    """Area of a flat polygon."""
    x, y, z = 0.0, 0.0, 0.0
    for i in range(1, count - 1):
        ax, bx = polygon[i, 0] - polygon[0, 0], polygon[i + 1, 0] - polygon[0, 0]
        ay, by = polygon[i, 1] - polygon[0, 1], polygon[i + 1, 1] - polygon[0, 1]
        az, bz = polygon[i, 2] - polygon[0, 2], polygon[i + 1, 2] - polygon[0, 2]
        x, y, z = x + ay * bz - az * by, y + az * bx - ax * bz, z + ax * by - ay * bx
    return 0.5 * np.sqrt(x * x + y * y + z * z)


@compiled
def _solve(matrix, right, size):
    """Of a symmetric positive matrix, by Cholesky, in place."""
    for i in range(size):
        for j in range(i + 1):
            total = matrix[i, j]
            for k in range(j):
                total -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = np.sqrt(max(total, 1e-300)) if i == j else total / matrix[j, j]
    for i in range(size):
        for k in range(i):
            right[i] -= matrix[i, k] * right[k]
        right[i] /= matrix[i, i]
    for i in range(size - 1, -1, -1):
        for k in range(i + 1, size):
            right[i] -= matrix[k, i] * right[k]
        right[i] /= matrix[i, i]


@compiled
def _fit(points, weights, labels, label, side, bent, rows, row):
    """Least squares of a patch through the points of a label, from the normal that rows[row] begins with."""
    nx, ny, nz = rows[row, 0], rows[row, 1], rows[row, 2]
    size = 6 if bent else 3
    basis, right, matrix = np.zeros(6), np.zeros(6), np.zeros((6, 6))
    for turn in range(3):  # the normal turns twice
        for j in range(size):
            right[j] = 0
            for k in range(size):
                matrix[j, k] = 0
        a, b, c, d, e, g = _tangents(nx, ny, nz)
        total = 0.0
        for i in range(len(points)):
            if labels[i] != label:
                continue
            x, y, z = points[i, 0] / side, points[i, 1] / side, points[i, 2] / side
            u, w = a * x + b * y + c * z, d * x + e * y + g * z
            basis[0], basis[1], basis[2], basis[3], basis[4], basis[5] = 1, u, w, 0.5 * u * u, u * w, 0.5 * w * w
            height = nx * x + ny * y + nz * z
            total += weights[i]
            for j in range(size):
                right[j] += weights[i] * basis[j] * height
                for k in range(j + 1):
                    matrix[j, k] += weights[i] * basis[j] * basis[k]
        for j in range(size):
            matrix[j, j] += total * (1e-12 if j < 3 else 1e-5)  # what few points leave open is flat
            if turn == 2 and 0 < j < 3:
                matrix[j, j] += 1e12 * total
        _solve(matrix, right, size)
        if turn < 2:
            nx -= right[1] * a + right[2] * d
            ny -= right[1] * b + right[2] * e
            nz -= right[1] * c + right[2] * g
            length = np.sqrt(nx * nx + ny * ny + nz * nz)
            nx, ny, nz = nx / length, ny / length, nz / length
    rows[row, 0], rows[row, 1], rows[row, 2], rows[row, 3] = nx, ny, nz, right[0] * side
    for j in range(3):
        rows[row, 4 + j] = right[3 + j] / side if bent else 0.0


@compiled
def _largest(points, labels, label, rows, row):
    """Largest |f| over the points of a label."""
    worst = 0.0
    for i in range(len(points)):
        if labels[i] == label:
            worst = max(worst, abs(_value(rows, row, points[i, 0], points[i, 1], points[i, 2])))
    return worst


@compiled
def _mean_normal(normals, areas, own, label, rows, row):
    """Into rows[row]: mean normal of the polygons of a label, on the side of the largest; whether there are any."""
    main = -1
    for i in range(len(own)):
        if own[i] == label and (main < 0 or areas[i] > areas[main]):
            main = i
    if main < 0:
        return False
    x, y, z = 0.0, 0.0, 0.0
    for i in range(len(own)):
        if own[i] == label:
            alike = 0.0
            for k in range(3):
                alike += normals[i, k] * normals[main, k]
            weight = areas[i] if alike >= 0 else -areas[i]
            x, y, z = x + weight * normals[i, 0], y + weight * normals[i, 1], z + weight * normals[i, 2]
    length = np.sqrt(x * x + y * y + z * z)
    rows[row, 0], rows[row, 1], rows[row, 2] = x / length, y / length, z / length
    return True


@compiled
def _plane_of(points, owner, normals, polygon, rows, row):
    """Into rows[row]: the plane of a polygon."""
    rows[row, 3] = rows[row, 4] = rows[row, 5] = rows[row, 6] = 0.0
    for j in range(len(owner)):
        if owner[j] == polygon:
            for k in range(3):
                rows[row, k] = normals[polygon, k]
            rows[row, 3] = _value(rows, row, points[j, 0], points[j, 1], points[j, 2])
            return


@compiled
def _cluster(points, weights, owner, labels, own, normals, areas, side, tolerance, rows, count):
    """Patches of `count` clusters of polygons: seeds far from all planes so far, then assignment and fit in turn.

    Returns the largest error; infinite where a cluster loses all its polygons.
    """
    off = np.zeros((len(own), count))  # of each polygon from each plane
    for i in range(len(own)):
        own[i] = 0
    for j in range(len(owner)):
        labels[j] = 0
    seed = 0
    for known in range(count if count > 1 else 0):
        for i in range(len(own)):
            off[i, 0] = 1.0 if known == 0 else 0.0
        for j in range(len(owner) if known else 0):
            nearest = np.inf
            for k in range(known):
                nearest = min(nearest, abs(_value(rows, k, points[j, 0], points[j, 1], points[j, 2])))
            off[owner[j], 0] = max(off[owner[j], 0], nearest)
        for i in range(len(own)):
            if off[i, 0] * np.sqrt(areas[i]) > off[seed, 0] * np.sqrt(areas[seed]):
                seed = i
        _plane_of(points, owner, normals, seed, rows, known)
    for _ in range(4 if count > 1 else 0):
        for i in range(len(own)):
            for k in range(count):
                off[i, k] = 0.0
        for j in range(len(owner)):
            for k in range(count):
                distance = abs(_value(rows, k, points[j, 0], points[j, 1], points[j, 2]))
                off[owner[j], k] = max(off[owner[j], k], distance)
        for i in range(len(own)):
            least = np.inf
            for k in range(count):  # of planes that are equally near, the one that lies as the polygon
                alike = 0.0
                for axis in range(3):
                    alike += rows[k, axis] * normals[i, axis]
                cost = off[i, k] + 0.05 * side * (1 - abs(alike))
                if cost < least:
                    least, own[i] = cost, k
        for j in range(len(owner)):
            labels[j] = own[owner[j]]
        for k in range(count):
            if not _mean_normal(normals, areas, own, k, rows, k):
                return np.inf
            _fit(points, weights, labels, k, side, False, rows, k)
    if count == 1:
        _mean_normal(normals, areas, own, 0, rows, 0)
        _fit(points, weights, labels, 0, side, False, rows, 0)
    error, bent = 0.0, np.zeros((1, WIDTH))
    for k in range(count):
        distance = _largest(points, labels, k, rows, k)
        if distance > FLAT * tolerance:
            for j in range(3):
                bent[0, j] = rows[k, j]
            _fit(points, weights, labels, k, side, True, bent, 0)
            closer = _largest(points, labels, k, bent, 0)
            most = max(abs(bent[0, 4]), abs(bent[0, 5]), abs(bent[0, 6]))
            if closer < distance and most * side < MOST_BENT:
                distance = closer
                for j in range(WIDTH):
                    rows[k, j] = bent[0, j]
        error = max(error, distance)
    return error


@compiled
def _keep(points, labels, trial, count, error, rows, codes, cell):
    """Into rows[cell], codes[cell]: the patches of a trial, each cut by every other one whose side it keeps to."""
    for i in range(count):
        for k in range(WIDTH):
            rows[cell, i, k] = trial[i, k]
        codes[cell, i] = LAST if i == count - 1 else 0
        for j in range(count):
            low, high = np.inf, -np.inf
            for k in range(len(points) if i != j else 0):
                if labels[k] == i:
                    value = _value(trial, j, points[k, 0], points[k, 1], points[k, 2])
                    low, high = min(low, value), max(high, value)
            if high > error and low >= -error:
                codes[cell, i] |= 1 << (2 + 2 * j)
            elif low < -error and high <= error:
                codes[cell, i] |= 2 << (2 + 2 * j)


@compiled
def fit_cells(corners, normals, lows, side, starts, triangles, tolerance, last):
    """Patches of cells of one side, from the triangles that may meet them.

    Args:
      corners, normals: of all triangles. lows: (n, 3) least corners of the cells.
      starts: (n + 1), where the cell's list of triangles begins.
      last: cells cannot be cut further, so that all are clustered.
    Returns:
      Patches (n, MOST, WIDTH), codes (n, MOST), numbers of patches (n), 0 where no triangle meets the cell; the largest
      distance (n) of the triangles to them; and which of `triangles` meet their cell.
    """
    cells = len(lows)
    rows, codes = np.zeros((cells, MOST, WIDTH)), np.zeros((cells, MOST), np.int64)
    counts, errors = np.zeros(cells, np.int64), np.zeros(cells)
    met = np.zeros(len(triangles), np.bool_)
    polygon, spare, trial = np.zeros((12, 3)), np.zeros((12, 3)), np.zeros((MOST, WIDTH))
    centre = np.zeros(3)
    for cell in range(cells):
        most = starts[cell + 1] - starts[cell]
        points, weights = np.zeros((19 * most, 3)), np.zeros(19 * most)
        owner, areas, facing = np.zeros(19 * most, np.int64), np.zeros(most), np.zeros((most, 3))
        for k in range(3):
            centre[k] = lows[cell, k] + 0.5 * side
        used, found = 0, 0
        for index in range(starts[cell], starts[cell + 1]):
            count = _clip(corners, triangles[index], lows, cell, side, polygon, spare)
            met[index] = count > 0
            areas[found] = _area(polygon, count)
            if areas[found] <= 1e-9 * side * side:
                continue
            for i in range(count):  # its corners, the middles of its sides, its centre
                for k in range(3):
                    here, there = polygon[i, k] - centre[k], polygon[(i + 1) % count, k] - centre[k]
                    points[used + 2 * i, k], points[used + 2 * i + 1, k] = here, 0.5 * (here + there)
                    points[used + 2 * count, k] += here / count
            for i in range(used, used + 2 * count + 1):
                weights[i], owner[i] = areas[found] / (2 * count + 1), found
            used += 2 * count + 1
            for k in range(3):
                facing[found, k] = normals[triangles[index], k]
            found += 1
        if found == 0:
            continue
        points, weights, owner = points[:used], weights[:used], owner[:used]
        areas, facing = areas[:found], facing[:found]
        labels, own, errors[cell] = np.zeros(used, np.int64), np.zeros(found, np.int64), np.inf
        for count in range(1, 1 + (min(MOST, found) if found <= _MANY or last else 1)):
            error = _cluster(points, weights, owner, labels, own, facing, areas, side, tolerance, trial, count)
            if error < errors[cell]:
                errors[cell], counts[cell] = error, count
                least = max(error, tolerance / (1 << FINEST))
                _keep(points, labels, trial, count, least, rows, codes, cell)
            if error <= tolerance:
                break
    return rows, codes, counts, errors, met


@compiled
def sample_patches(patches, codes, sides):
    """Points of patches inside their cells, from the centre, in a grid along the two axes that they face least.

    Args:
      patches, codes: of cells one after the other. sides: of the cell of each patch.
    Returns:
      (n, GRID², 3), `nan` where the patch is cut or leaves its cell.
    """
    out = np.full((len(patches), GRID * GRID, 3), np.nan)
    point, first = np.zeros(3), 0
    for i in range(len(patches)):
        if i > 0 and codes[i - 1] & LAST:
            first = i
        side, axis = sides[i], 0
        for k in range(1, 3):
            axis = k if abs(patches[i, k]) > abs(patches[i, axis]) else axis
        for sample in range(GRID * GRID):
            point[axis] = 0
            point[(axis + 1) % 3] = ((sample // GRID + 0.5) / GRID - 0.5) * side
            point[(axis + 2) % 3] = ((sample % GRID + 0.5) / GRID - 0.5) * side
            for _ in range(4):  # Newton: once for a plane
                point[axis] -= _value(patches, i, point[0], point[1], point[2]) / patches[i, axis]
            held = abs(point[axis]) <= 0.5 * side
            for j in range(MOST):
                cut = codes[i] >> (2 + 2 * j) & 3
                if cut and held:
                    other = _value(patches, first + j, point[0], point[1], point[2])
                    held = other >= 0 if cut == 1 else other <= 0
            if held:
                for k in range(3):
                    out[i, sample, k] = point[k]
    return out


@compiled
def cut_cells(corners, lows, side, starts, triangles, met):
    """The eight parts of cells and, of each, the triangles of the cell whose boxes meet it: lists as of `fit_cells`."""
    cells, half = len(lows), 0.5 * side
    parts, begins = np.zeros((8 * cells, 3)), np.zeros(8 * cells + 1, np.int64)
    found = np.zeros(8 * len(met), np.int64)
    used = 0
    for cell in range(cells):
        for part in range(8):
            new = 8 * cell + part
            for axis in range(3):
                parts[new, axis] = lows[cell, axis] + half * (part >> (2 - axis) & 1)
            for index in range(starts[cell], starts[cell + 1]):
                if met[index]:
                    t, apart = triangles[index], False
                    for axis in range(3):
                        a, b, c = corners[t, 0, axis], corners[t, 1, axis], corners[t, 2, axis]
                        apart = apart or min(a, b, c) > parts[new, axis] + half or max(a, b, c) < parts[new, axis]
                    if not apart:
                        found[used] = t
                        used += 1
            begins[new + 1] = used
    return parts, begins, found[:used]
