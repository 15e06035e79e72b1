"""The loops of the z-buffer, compiled.

- `normals_of`: normals of the vertices of a mesh.
- `visible`: the nearest triangle at each sample of a picture.
- `shade`, `lit`: light on what is visible.
- `wires`, `spots`: edges of triangles and dots on top.

No operation is reordered: the same input gives the same bytes on every machine, which a graphics driver does not
promise. Points are columns and rows in samples; depth grows towards the viewer, in millimetres.
"""

from __future__ import annotations

import math

from signface.compiling import compiled

#: Samples of a pixel whose depths differ less lie on one surface; a dot deeper than that under the skin is hidden (mm).
SAME_SURFACE_MM, HIDDEN_MM = 2.0, 3.0


@compiled()
def normals_of(points, triangles, normals):
    """Sum the normals of the triangles around each vertex, each as long as twice its triangle's area."""
    normals[:] = 0.0
    for t in range(len(triangles)):
        a, b, c = triangles[t]
        ux, uy, uz = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1], points[b, 2] - points[a, 2]
        vx, vy, vz = points[c, 0] - points[a, 0], points[c, 1] - points[a, 1], points[c, 2] - points[a, 2]
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        for k in (a, b, c):
            normals[k, 0] += nx
            normals[k, 1] += ny
            normals[k, 2] += nz


@compiled()
def visible(points, triangles, depth, owner, first, second):
    """Find the nearest triangle at each sample, its depth there, and the weights of its first two corners."""
    height, width = depth.shape
    depth[:] = -1e30
    owner[:] = -1
    for t in range(len(triangles)):
        a, b, c = triangles[t]
        ax, ay, az = points[a]
        bx, by, bz = points[b]
        cx, cy, cz = points[c]
        double = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
        if double == 0.0:
            continue
        left = max(0, math.ceil(min(ax, bx, cx) - 0.5))
        right = min(width - 1, math.floor(max(ax, bx, cx) - 0.5))
        top = max(0, math.ceil(min(ay, by, cy) - 0.5))
        bottom = min(height - 1, math.floor(max(ay, by, cy) - 0.5))
        # Barycentric weights and depth are linear in the pixel: they are stepped along a row.
        step_a, step_b = (by - cy) / double, (cy - ay) / double
        step_z = step_a * az + step_b * bz - (step_a + step_b) * cz
        for y in range(top, bottom + 1):
            py, px = y + 0.5, left + 0.5
            wa = ((bx - px) * (cy - py) - (cx - px) * (by - py)) / double
            wb = ((cx - px) * (ay - py) - (ax - px) * (cy - py)) / double
            z = wa * az + wb * bz + (1.0 - wa - wb) * cz
            for x in range(left, right + 1):
                if wa >= 0.0 and wb >= 0.0 and wa + wb <= 1.0 and z > depth[y, x]:
                    depth[y, x] = z
                    owner[y, x] = t
                    first[y, x] = wa
                    second[y, x] = wb
                wa += step_a
                wb += step_b
                z += step_z


@compiled()
def lit(nx, ny, nz, lights, ambient, shine):
    """Light and gloss of a surface with a normal of any length."""
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    if length > 0.0:
        if nz < 0.0:  # the inside of an open mesh is lit like its outside
            length = -length
        nx, ny, nz = nx / length, ny / length, nz / length
    light, gloss = ambient, 0.0
    for number in range(len(lights)):
        facing = nx * lights[number, 0] + ny * lights[number, 1] + nz * lights[number, 2]
        if facing > 0.0:
            light += lights[number, 3] * facing
    # Half way between the viewer and the first light.
    facing = nx * lights[0, 0] + ny * lights[0, 1] + nz * (lights[0, 2] + 1.0)
    if facing > 0.0:
        facing *= facing / (2.0 + 2.0 * lights[0, 2])  # to the power 32, of the cosine
        facing *= facing
        facing *= facing
        facing *= facing
        gloss = shine * facing * facing
    return light, gloss


@compiled()
def shade(triangles, normals, colours, lights, owner, first, second, depth, settings, picture):
    """Light every pixel: once where its samples lie on one surface, sample by sample on an outline."""
    height, width, _ = picture.shape
    samples = owner.shape[0] // height
    ambient, shine, red, green, blue = settings
    share = 1.0 / (samples * samples)
    for y in range(height):
        for x in range(width):
            r = g = b = 0.0
            sum_x = sum_y = sum_z = sum_r = sum_g = sum_b = 0.0
            seen, near, far = 0, -1e30, 1e30
            for sy in range(y * samples, (y + 1) * samples):
                for sx in range(x * samples, (x + 1) * samples):
                    if owner[sy, sx] >= 0:
                        seen += 1
                        near, far = max(near, depth[sy, sx]), min(far, depth[sy, sx])
            whole = near - far < SAME_SURFACE_MM
            for sy in range(y * samples, (y + 1) * samples):
                for sx in range(x * samples, (x + 1) * samples):
                    if seen == 0:
                        continue
                    t = owner[sy, sx]
                    if t < 0:
                        continue
                    i, j, k = triangles[t]
                    wi, wj = first[sy, sx], second[sy, sx]
                    wk = 1.0 - wi - wj
                    nx = wi * normals[i, 0] + wj * normals[j, 0] + wk * normals[k, 0]
                    ny = wi * normals[i, 1] + wj * normals[j, 1] + wk * normals[k, 1]
                    nz = wi * normals[i, 2] + wj * normals[j, 2] + wk * normals[k, 2]
                    cr = wi * colours[i, 0] + wj * colours[j, 0] + wk * colours[k, 0]
                    cg = wi * colours[i, 1] + wj * colours[j, 1] + wk * colours[k, 1]
                    cb = wi * colours[i, 2] + wj * colours[j, 2] + wk * colours[k, 2]
                    if whole:
                        sum_x, sum_y, sum_z = sum_x + nx, sum_y + ny, sum_z + nz
                        sum_r, sum_g, sum_b = sum_r + cr, sum_g + cg, sum_b + cb
                        continue
                    light, gloss = lit(nx, ny, nz, lights, ambient, shine)
                    r += min(1.0, cr * light + gloss)
                    g += min(1.0, cg * light + gloss)
                    b += min(1.0, cb * light + gloss)
            if whole and seen:
                light, gloss = lit(sum_x, sum_y, sum_z, lights, ambient, shine)
                r = min(seen, sum_r * light + seen * gloss)
                g = min(seen, sum_g * light + seen * gloss)
                b = min(seen, sum_b * light + seen * gloss)
            empty = samples * samples - seen
            picture[y, x, 0] = int(255.0 * min(1.0, share * (r + empty * red)) + 0.5)
            picture[y, x, 1] = int(255.0 * min(1.0, share * (g + empty * green)) + 0.5)
            picture[y, x, 2] = int(255.0 * min(1.0, share * (b + empty * blue)) + 0.5)


@compiled()
def wires(points, triangles, owner, first, second, width, dark, picture):
    """Darken each pixel by the share of its samples that lie on an edge."""
    height, columns, _ = picture.shape
    samples = owner.shape[0] // height
    share = (1.0 - dark) / (samples * samples)
    for y in range(height):
        for x in range(columns):
            kept = 1.0
            for sy in range(y * samples, (y + 1) * samples):
                for sx in range(x * samples, (x + 1) * samples):
                    t = owner[sy, sx]
                    if t < 0:
                        continue
                    i, j, k = triangles[t]
                    ax, ay = points[i, 0], points[i, 1]
                    bx, by = points[j, 0], points[j, 1]
                    cx, cy = points[k, 0], points[k, 1]
                    # Distance to an edge: a weight times the height of the triangle on that edge.
                    double = abs((bx - ax) * (cy - ay) - (cx - ax) * (by - ay))
                    wi, wj = first[sy, sx], second[sy, sx]
                    near = wi * double / math.hypot(cx - bx, cy - by)
                    near = min(near, wj * double / math.hypot(cx - ax, cy - ay))
                    near = min(near, (1.0 - wi - wj) * double / math.hypot(bx - ax, by - ay))
                    if near < width:
                        kept -= share
            for channel in range(3):
                picture[y, x, channel] = int(picture[y, x, channel] * kept + 0.5)


@compiled()
def spots(dots, depth, radius, red, green, blue, picture):
    """Draw a disc at each dot (column, row, depth, in samples) that the mesh does not hide."""
    height, width, _ = picture.shape
    samples = depth.shape[0] // height
    for number in range(len(dots)):
        column, row, z = dots[number]
        x, y = int(column), int(row)
        if not (0 <= x < depth.shape[1] and 0 <= y < depth.shape[0]) or z < depth[y, x] - HIDDEN_MM:
            continue
        reach = int(radius / samples) + 2
        for py in range(max(0, y // samples - reach), min(height, y // samples + reach + 1)):
            for px in range(max(0, x // samples - reach), min(width, x // samples + reach + 1)):
                distance = math.hypot((px + 0.5) * samples - column, (py + 0.5) * samples - row)
                cover = min(1.0, max(0.0, (radius - distance) / samples + 0.5))
                picture[py, px, 0] = int(picture[py, px, 0] * (1.0 - cover) + red * cover)
                picture[py, px, 1] = int(picture[py, px, 1] * (1.0 - cover) + green * cover)
                picture[py, px, 2] = int(picture[py, px, 2] * (1.0 - cover) + blue * cover)
