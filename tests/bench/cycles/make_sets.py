#!/usr/bin/env python3
"""Makes the bench's own ground truth sets, which have no caustics: interior, lamps, low_sun, foliage.

    tests/bench/cycles/make_sets.py OUT

writes OUT/NAME/{set.json,phantom.glb,virtual.glb,env.exr} in the format of ../../truth/README.md, without
pictures; the same files every time. Needs Debian's python3-numpy.
"""

import json
import math
import pathlib
import struct
import sys
import zlib

import numpy as np

ENV_WIDTH, ENV_HEIGHT = 512, 256
WIDTH, HEIGHT = 640, 480


# Files

def write_exr(file, picture):
    """An uncompressed scanline file of 32-bit floats."""
    height, width, _ = picture.shape

    def attribute(name, kind, value):
        return name + b"\0" + kind + b"\0" + struct.pack("<I", len(value)) + value

    box = struct.pack("<4i", 0, 0, width - 1, height - 1)
    channels = b"".join(c + b"\0" + struct.pack("<I4xII", 2, 1, 1) for c in (b"B", b"G", b"R"))
    header = b"".join([
        attribute(b"channels", b"chlist", channels + b"\0"),
        attribute(b"compression", b"compression", b"\0"),
        attribute(b"dataWindow", b"box2i", box), attribute(b"displayWindow", b"box2i", box),
        attribute(b"lineOrder", b"lineOrder", b"\0"),
        attribute(b"pixelAspectRatio", b"float", struct.pack("<f", 1)),
        attribute(b"screenWindowCenter", b"v2f", struct.pack("<2f", 0, 0)),
        attribute(b"screenWindowWidth", b"float", struct.pack("<f", 1))])
    header = struct.pack("<II", 20000630, 2) + header + b"\0"
    rows = [struct.pack("<iI", y, 12 * width) + row[:, ::-1].T.astype("<f4").tobytes()
            for y, row in enumerate(picture)]
    first = len(header) + 8 * height
    offsets = [first + y * len(rows[0]) for y in range(height)]
    file.write_bytes(header + struct.pack(f"<{height}Q", *offsets) + b"".join(rows))


def png(alpha):
    """White, with this alpha in [0, 1]."""
    height, width = alpha.shape
    pixels = np.full((height, width, 4), 255, np.uint8)
    pixels[..., 3] = np.round(255 * alpha)
    data = b"".join(b"\0" + row.tobytes() for row in pixels)

    def chunk(kind, body):
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 6, 0, 0, 0)) +
            chunk(b"IDAT", zlib.compress(data, 9)) + chunk(b"IEND", b""))


class Glb:
    """A glTF file under construction. Everything it is given is in the world's axes, Z up."""

    def __init__(self):
        self.binary = b""
        self.json = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": []}], "nodes": [], "meshes": [],
                     "materials": [], "accessors": [], "bufferViews": [],
                     "extensionsUsed": ["KHR_materials_specular"]}

    def view(self, data):
        self.binary += b"\0" * (-len(self.binary) % 4)
        self.json["bufferViews"].append({"buffer": 0, "byteOffset": len(self.binary), "byteLength": len(data)})
        self.binary += data
        return len(self.json["bufferViews"]) - 1

    def accessor(self, values, kind):
        values = np.ascontiguousarray(values, "<u4" if kind == "SCALAR" else "<f4")
        accessor = {"bufferView": self.view(values.tobytes()), "count": len(values), "type": kind,
                    "componentType": 5125 if kind == "SCALAR" else 5126}
        if kind == "VEC3":
            accessor |= {"min": values.min(0).tolist(), "max": values.max(0).tolist()}
        self.json["accessors"].append(accessor)
        return len(self.json["accessors"]) - 1

    def texture(self, picture):
        for key in ("images", "textures"):
            self.json.setdefault(key, [])
        self.json["images"].append({"bufferView": self.view(picture), "mimeType": "image/png"})
        self.json["textures"].append({"source": len(self.json["images"]) - 1})
        return {"index": len(self.json["textures"]) - 1}

    def material(self, name, spec):
        for index, material in enumerate(self.json["materials"]):
            if material["name"] == name:
                return index
        surface = {"baseColorFactor": [*spec["albedo"], 1], "metallicFactor": 0,
                   "roughnessFactor": spec.get("roughness", 1)}
        material = {"name": name, "doubleSided": True, "pbrMetallicRoughness": surface}
        if spec["type"] == "diffuse":
            material["extensions"] = {"KHR_materials_specular": {"specularFactor": 0}}
        if "alpha_cutoff" in spec:
            surface["baseColorTexture"] = self.texture(png(ALPHA[name]))
            material |= {"alphaMode": "MASK", "alphaCutoff": spec["alpha_cutoff"]}
        self.json["materials"].append(material)
        return len(self.json["materials"]) - 1

    def add(self, name, mesh, material, spec):
        points, normals, uv, triangles = mesh
        to_gltf = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])  # (x, y, z) becomes (x, z, -y)
        attributes = {"POSITION": self.accessor(points @ to_gltf.T, "VEC3"),
                      "NORMAL": self.accessor(normals @ to_gltf.T, "VEC3"), "TEXCOORD_0": self.accessor(uv, "VEC2")}
        self.json["meshes"].append({"primitives": [{
            "attributes": attributes, "indices": self.accessor(triangles.reshape(-1), "SCALAR"),
            "material": self.material(material, spec)}]})
        self.json["nodes"].append({"name": name, "mesh": len(self.json["meshes"]) - 1})
        self.json["scenes"][0]["nodes"].append(len(self.json["nodes"]) - 1)

    def write(self, file):
        self.json["buffers"] = [{"byteLength": len(self.binary)}]
        text = json.dumps(self.json).encode()
        text += b" " * (-len(text) % 4)
        binary = self.binary + b"\0" * (-len(self.binary) % 4)
        file.write_bytes(struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(binary)) +
                         struct.pack("<I4s", len(text), b"JSON") + text +
                         struct.pack("<I4s", len(binary), b"BIN\0") + binary)


# Meshes: points, normals, texture coordinates, triangles

def normalized(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def grid(points, uv_scale=(1, 1)):
    """A surface over a grid of points, (rows, columns, 3)."""
    rows, columns, _ = points.shape
    along, across = np.gradient(points, axis=1), np.gradient(points, axis=0)
    normals = normalized(np.cross(along, across))
    v, u = np.meshgrid(np.linspace(0, uv_scale[1], rows), np.linspace(0, uv_scale[0], columns), indexing="ij")
    first = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).reshape(-1)
    a, b, c, d = first, first + 1, first + columns + 1, first + columns
    triangles = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    return points.reshape(-1, 3), normals.reshape(-1, 3), np.stack([u, v], -1).reshape(-1, 2), triangles


def quad(corner, x, y):
    corner, x, y = (np.array(v, float) for v in (corner, x, y))
    return grid(np.array([[corner, corner + x], [corner + y, corner + x + y]]))


def joined(meshes):
    first = np.cumsum([0] + [len(mesh[0]) for mesh in meshes])
    parts = [np.concatenate([mesh[i] for mesh in meshes]) for i in range(3)]
    return (*parts, np.concatenate([mesh[3] + start for mesh, start in zip(meshes, first)]))


def turned(mesh, degrees, centre):
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    return ((mesh[0] - centre) @ turn.T + centre, mesh[1] @ turn.T, mesh[2], mesh[3])


def box(centre, size, degrees=0):
    x, y, z = (np.eye(3)[i] * size[i] for i in range(3))
    low = np.array(centre) - (x + y + z) / 2
    sides = [(low, y, x), (low + z, x, y), (low, x, z), (low + y, z, x), (low, z, y), (low + x, y, z)]
    return turned(joined([quad(*side) for side in sides]), degrees, np.array(centre))


def ball(centre, radius, rows=24):
    polar, azimuth = np.meshgrid(np.linspace(1e-3, math.pi - 1e-3, rows + 1), np.linspace(2 * math.pi, 0, 2 * rows + 1),
                                 indexing="ij")
    unit = np.stack([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)], -1)
    _, _, uv, triangles = grid(unit)
    unit = unit.reshape(-1, 3)
    return np.array(centre) + radius * unit, unit, uv, triangles


def knot(centre, size, thickness, steps=120, around=10):
    """A (2, 3) torus knot."""
    def curve(t):
        ring = 2 + np.cos(3 * t)
        return size / 3 * np.stack([ring * np.cos(2 * t), ring * np.sin(2 * t), np.sin(3 * t)], -1)

    t = np.linspace(0, 2 * math.pi, steps + 1)[:, None]
    along = normalized(curve(t + 1e-4) - curve(t - 1e-4))
    side = normalized(np.cross(along, curve(t)))
    angle = np.linspace(0, 2 * math.pi, around + 1)[None, :, None]
    normals = np.cos(angle) * side + np.sin(angle) * np.cross(along, side)
    points, _, uv, triangles = grid(np.array(centre) + curve(t) + thickness * normals)
    return points, normals.reshape(-1, 3), uv, triangles


def cloth(corner, width, height, folds, depth, weave):
    """Hangs in the plane of x and z, with folds towards y."""
    v, u = np.meshgrid(np.linspace(0, 1, 12), np.linspace(0, 1, 40), indexing="ij")
    points = np.stack([u * width, depth * np.sin(2 * math.pi * folds * u) * (1.2 - v), v * height], -1)
    return grid(np.array(corner) + points, (weave * width, weave * height))


def plant(centre, leaves, length, random):
    """Leaves that spread from a place on the ground."""
    meshes = []
    for i in range(leaves):
        azimuth = 2.4 * i + random.uniform(-0.3, 0.3)
        rise = random.uniform(0.5, 1.3)
        out = np.array([math.cos(azimuth), math.sin(azimuth), 0])
        side = np.array([-out[1], out[0], 0]) * length * 0.2
        t = np.linspace(0, 1, 5)[:, None]
        spine = np.array(centre) + length * (t * math.cos(rise) * out +
                                             (t * math.sin(rise) - 0.35 * t * t) * np.array([0, 0, 1]))
        meshes.append(grid(np.stack([spine - side, spine + side], 1)))
    return joined(meshes)


# Alpha of the materials that have one

def leaf_alpha(size=64):
    v, u = np.meshgrid((np.arange(size) + 0.5) / size, (np.arange(size) + 0.5) / size, indexing="ij")
    width = 0.42 * np.sqrt(np.sin(math.pi * np.clip(v, 0.02, 0.98))) * (1 - 0.25 * np.abs(np.sin(9 * math.pi * v)))
    return (np.abs(u - 0.5) < width).astype(float)


def weave_alpha(size=32):
    v, u = np.meshgrid(*[(np.arange(size) + 0.5) / size] * 2, indexing="ij")
    return ((np.abs(u - 0.5) > 0.25) | (np.abs(v - 0.5) > 0.25)).astype(float)


ALPHA = {"leaf": leaf_alpha(), "young_leaf": leaf_alpha(), "cloth": weave_alpha(), "red_cloth": weave_alpha()}


# Light

def directions():
    azimuth = 2 * math.pi * (0.5 - (np.arange(ENV_WIDTH) + 0.5) / ENV_WIDTH)
    elevation = math.pi * (0.5 - (np.arange(ENV_HEIGHT) + 0.5) / ENV_HEIGHT)
    e, a = np.meshgrid(elevation, azimuth, indexing="ij")
    return np.stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)], -1)


def direction(azimuth_deg, elevation_deg):
    a, e = math.radians(azimuth_deg), math.radians(elevation_deg)
    return np.array([math.cos(e) * math.cos(a), math.cos(e) * math.sin(a), math.sin(e)])


def sky(zenith, horizon, ground, sun=None):
    """A sky over a ground; sun: azimuth and elevation in degrees, radius in degrees, radiance."""
    d = directions()
    up = np.clip(d[..., 2:], 0, 1) ** 0.5
    picture = np.where(d[..., 2:] > 0, (1 - up) * np.array(horizon) + up * np.array(zenith), np.array(ground))
    if sun:
        azimuth, elevation, radius, radiance = sun
        picture[d @ direction(azimuth, elevation) > math.cos(math.radians(radius))] = radiance
    return picture


# Sets

def diffuse(*albedo, **more):
    return {"type": "diffuse", "albedo": albedo, **more}


def plastic(roughness, *albedo):
    return {"type": "plastic", "albedo": albedo, "roughness": roughness}


def camera(eye, target, width_deg, exposure):
    eye = np.array(eye, float)
    forward = normalized(np.array(target) - eye)
    right = normalized(np.cross(forward, [0, 0, 1]))
    pose = np.eye(4)
    pose[:3] = np.stack([right, np.cross(forward, right), forward, eye], 1)
    f = WIDTH / 2 / math.tan(math.radians(width_deg / 2))
    return {"width": WIDTH, "height": HEIGHT, "K": [[f, 0, (WIDTH - 1) / 2], [0, f, (HEIGHT - 1) / 2], [0, 0, 1]],
            "lens": None, "exposure": exposure, "response": "sRGB_OETF(clip(signal))",
            "poses_world_from_camera": {"0000": pose.tolist()}}


def interior():
    wall = {"wall_back": quad((-2, 2.5, 0), (4, 0, 0), (0, 0, 2.6)),
            "wall_front": quad((-2, -2.5, 0), (4, 0, 0), (0, 0, 2.6)),
            "wall_right": quad((2, -2.5, 0), (0, 5, 0), (0, 0, 2.6)),
            "ceiling": quad((-2, -2.5, 2.6), (4, 0, 0), (0, 5, 0)),
            # The wall around the window.
            "wall_left": joined([quad((-2, -2.5, 0), (0, 5, 0), (0, 0, 0.7)),
                                 quad((-2, -2.5, 2.3), (0, 5, 0), (0, 0, 0.3)),
                                 quad((-2, -2.5, 0.7), (0, 0.3, 0), (0, 0, 1.6)),
                                 quad((-2, 1.0, 0.7), (0, 1.5, 0), (0, 0, 1.6))])}
    real = [(name, mesh, "wall") for name, mesh in wall.items()]
    real += [("floor", quad((-2, -2.5, 0), (4, 0, 0), (0, 5, 0)), "boards"),
             ("table", box((0, 0.8, 0.72), (1.6, 0.9, 0.05)), "table"),
             *[(f"leg{i}", box((x, y, 0.35), (0.06, 0.06, 0.7)), "table")
               for i, (x, y) in enumerate([(-0.7, 0.45), (0.7, 0.45), (-0.7, 1.15), (0.7, 1.15)])]]
    virtual = [("knot", knot((-0.2, 0.8, 0.96), 0.24, 0.055), "clay"),
               ("box", box((0.42, 0.75, 0.87), (0.22, 0.22, 0.25), 30), "blue"),
               ("ball", ball((-1.3, 1.65, 0.35), 0.35), "clay")]
    materials = {"wall": diffuse(0.7, 0.68, 0.63), "boards": diffuse(0.35, 0.25, 0.17),
                 "table": diffuse(0.5, 0.4, 0.3), "clay": diffuse(0.65, 0.35, 0.22), "blue": diffuse(0.15, 0.25, 0.55)}
    return {"camera": camera((0.7, -0.9, 1.45), (0.0, 0.75, 0.82), 55, 1.0), "materials": materials,
            "real": real, "virtual": virtual, "env": sky((3, 4, 6), (6, 6, 6), (1.2, 1.1, 0.9))}


def lamps():
    random = np.random.default_rng(1)
    real = [("floor", quad((-5, -5, 0), (10, 0, 0), (0, 10, 0)), "floor"),
            ("wall_back", quad((-5, 5, 0), (10, 0, 0), (0, 0, 5)), "wall"),
            ("wall_left", quad((-5, -5, 0), (0, 10, 0), (0, 0, 5)), "wall"),
            ("wall_right", quad((5, -5, 0), (0, 10, 0), (0, 0, 5)), "wall"),
            ("pillar", box((-2.2, 2.2, 1.5), (0.5, 0.5, 3)), "wall")]
    virtual = [("knot", knot((-0.6, 0.6, 0.62), 0.6, 0.14), "clay"),
               ("box", box((0.9, 0.3, 0.45), (0.7, 0.7, 0.9), 25), "blue"),
               ("ball", ball((1.9, 1.6, 0.5), 0.5), "clay")]
    materials = {"floor": diffuse(0.45, 0.43, 0.4), "wall": diffuse(0.6, 0.6, 0.6), "clay": diffuse(0.7, 0.5, 0.3),
                 "blue": diffuse(0.2, 0.3, 0.6)}
    bulbs = []
    for i in range(100):
        place = [-4.5 + (i % 10) + random.uniform(-0.3, 0.3), -4.5 + (i // 10) + random.uniform(-0.3, 0.3),
                 random.uniform(3.6, 4.4)]
        radius = random.uniform(0.02, 0.06)
        flux = 0.25 * 10 ** random.uniform(-1, 1)  # over pi^2: of the radiance and the squared radius
        bulbs.append({"position": place, "radius_m": radius,
                      "radiance": (flux / radius ** 2 * random.uniform(0.1, 1, 3) ** 2).tolist()})
    return {"camera": camera((0.4, -4.6, 2.6), (0.2, 0.8, 0.2), 55, 1.0), "materials": materials,
            "real": real, "virtual": virtual, "lamps": bulbs, "env": sky(*[(0.02, 0.02, 0.03)] * 3)}


def low_sun():
    real = [("floor", quad((-8, -8, 0), (16, 0, 0), (0, 16, 0)), "floor"),
            ("block", box((-1.6, 1.6, 0.4), (0.8, 0.8, 0.8), 15), "stone")]
    virtual = [("knot", knot((0, 0.6, 0.6), 0.55, 0.13), "clay"),
               ("post", box((1.2, 1.2, 0.7), (0.25, 0.25, 1.4), 20), "white"),
               ("ball", ball((-0.6, -0.5, 0.3), 0.3), "blue")]
    materials = {"floor": plastic(0.3, 0.2, 0.19, 0.18), "stone": diffuse(0.4, 0.38, 0.35),
                 "clay": diffuse(0.7, 0.35, 0.2), "white": diffuse(0.75, 0.75, 0.75), "blue": diffuse(0.2, 0.3, 0.6)}
    sun = (150, 20, 1.2, (700, 520, 320))
    return {"camera": camera((0.6, -4, 1.1), (0.1, 0.6, 0.35), 44, 2.0), "materials": materials,
            "real": real, "virtual": virtual,
            "env": sky((0.04, 0.06, 0.1), (0.13, 0.11, 0.09), (0.03, 0.03, 0.03), sun)}


def foliage():
    random = np.random.default_rng(2)
    real = [("ground", quad((-6, -6, 0), (12, 0, 0), (0, 12, 0)), "ground"),
            ("pole", box((-2.1, 1.5, 0.9), (0.06, 0.06, 1.8)), "wood"),
            ("curtain", cloth((-2.1, 1.5, 0.25), 1.5, 1.5, 3, 0.08, 14), "cloth"),
            *[(f"bush{i}", plant((x, y, 0), 24, 0.7, random), "leaf")
              for i, (x, y) in enumerate([(-1.6, 0.6), (1.9, 2.0), (1.2, 2.6)])]]
    virtual = [("flag", cloth((0.2, 1.2, 0.3), 1.2, 1.1, 2, 0.08, 14), "red_cloth"),
               ("flag_pole", box((0.2, 1.2, 0.75), (0.05, 0.05, 1.5)), "wood"),
               *[(f"plant{i}", plant((x, y, 0), 24, 0.75, random), "young_leaf")
                 for i, (x, y) in enumerate([(-0.35, 0.1), (0.9, -0.1)])],
               ("ball", ball((0.3, 0.3, 0.2), 0.2), "clay")]
    materials = {"ground": diffuse(0.35, 0.3, 0.22), "wood": diffuse(0.4, 0.28, 0.18), "clay": diffuse(0.7, 0.4, 0.25),
                 "cloth": diffuse(0.6, 0.58, 0.5, alpha_cutoff=0.5),
                 "red_cloth": diffuse(0.6, 0.12, 0.1, alpha_cutoff=0.5),
                 "leaf": diffuse(0.12, 0.3, 0.08, alpha_cutoff=0.5),
                 "young_leaf": diffuse(0.25, 0.45, 0.1, alpha_cutoff=0.5)}
    sun = (60, 42, 1.2, (900, 850, 750))
    return {"camera": camera((0.3, -3.2, 1.7), (0.05, 0.6, 0.3), 46, 1.1), "materials": materials,
            "real": real, "virtual": virtual, "env": sky((0.3, 0.5, 0.9), (0.7, 0.75, 0.8), (0.2, 0.18, 0.15), sun)}


def write_set(directory, made):
    directory.mkdir(parents=True, exist_ok=True)
    for kind, file in (("real", "phantom.glb"), ("virtual", "virtual.glb")):
        glb = Glb()
        for name, mesh, material in made[kind]:
            glb.add(name, mesh, material, made["materials"][material])
        glb.write(directory / file)
    write_exr(directory / "env.exr", made["env"])
    description = {"name": directory.name, "observer": made["camera"], "env": {"file": "env.exr"},
                   "gltf": {"phantom": "phantom.glb", "virtual": "virtual.glb", "materials": made["materials"]},
                   "lamps": made.get("lamps", [])}
    (directory / "set.json").write_text(json.dumps(description, indent=1) + "\n")


def main():
    if len(sys.argv) != 2:
        sys.exit(f"usage: {sys.argv[0]} OUT")
    for make in (interior, lamps, low_sun, foliage):
        write_set(pathlib.Path(sys.argv[1]) / make.__name__, make())


main()
