"""Renders one frame of a ground truth set with Cycles' shadow catcher.

    blender --background --factory-startup --python-exit-code 1 --python shadow_catcher.py -- \
        --set SETDIR --frame 0 --width 160 --samples 16,64 --seed 1 --threads 2 --out DIR

Real objects are shadow catchers, virtual ones ordinary objects; materials, light, camera and pixel
filter are those of set.json (see ../../truth/README.md), but for the lens's distortion, which Cycles
does not have. Nothing that would bias the picture is on: no clamping, no glossy filter, no denoiser,
no adaptive sampling; caustics are traced, as deep as the set's truth. What does not bias it is as
Blender has it by default, as the light tree and the pattern of samples are.

Works in Blender 3.4 (Debian 12) and 4.3 (Debian 13).

Writes DIR/SAMPLES.exr (multi-layer: Combined, Shadow Catcher) and DIR/renders.csv with the CPU
seconds of all threads of each render. A render before them builds what they share.
"""

import argparse
import csv
import json
import math
import pathlib
import resource
import sys

import bpy
import mathutils
import numpy

# Debian 12's glTF importer names a type that Debian 12's numpy no longer has.
if not hasattr(numpy, "bool"):
    numpy.bool = bool

IS_BEFORE_4 = bpy.app.version < (4, 0)
MIRROR = "SHARP" if IS_BEFORE_4 else "GGX"  # of roughness 0
LINEAR = "Linear" if IS_BEFORE_4 else "Linear Rec.709"
BOUNCES = 16  # of the truth's


def arguments():
    parser = argparse.ArgumentParser(prog="shadow_catcher.py")
    parser.add_argument("--set", type=pathlib.Path, required=True, dest="directory")
    parser.add_argument("--frame", type=int, default=0)
    parser.add_argument("--width", type=int, required=True)
    parser.add_argument("--samples", required=True)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--threads", type=int, required=True)
    parser.add_argument("--out", type=pathlib.Path, required=True)
    return parser.parse_args(sys.argv[sys.argv.index("--") + 1:])


class Shader:
    """A material's node tree under construction."""

    def __init__(self, material):
        material.use_nodes = True
        self.tree = material.node_tree
        self.tree.nodes.clear()

    def node(self, kind, **inputs):
        node = self.tree.nodes.new(kind)
        for name, value in inputs.items():
            self.connect(node.inputs[name], value)
        return node

    def connect(self, socket, value):
        if isinstance(value, bpy.types.NodeSocket):
            self.tree.links.new(value, socket)
        else:
            socket.default_value = value

    def math(self, operation, *operands):
        node = self.node("ShaderNodeMath")
        node.operation = operation
        for socket, value in zip(node.inputs, operands):
            self.connect(socket, value)
        return node.outputs[0]

    def mix(self, share, without, whole):
        node = self.node("ShaderNodeMixShader")
        for socket, value in zip(node.inputs, (share, without, whole)):
            self.connect(socket, value)
        return node.outputs[0]

    def output(self, surface):
        self.node("ShaderNodeOutputMaterial", Surface=surface)


def glossy(shader, color, roughness):
    node = shader.node("ShaderNodeBsdfGlossy", Color=color, Roughness=roughness)
    node.distribution = "GGX" if roughness > 0 else MIRROR
    return node.outputs[0]


def schlick_color(shader, f0):
    """F0 + (1 - F0)(1 - cos)^5, cos between the shading normal and the viewer."""
    geometry = shader.node("ShaderNodeNewGeometry")
    dot = shader.node("ShaderNodeVectorMath")
    dot.operation = "DOT_PRODUCT"
    shader.connect(dot.inputs[0], geometry.outputs["Normal"])
    shader.connect(dot.inputs[1], geometry.outputs["Incoming"])
    grazing = shader.math("POWER", shader.math("SUBTRACT", 1.0, dot.outputs["Value"]), 5.0)
    mix = shader.node("ShaderNodeMixRGB", Fac=grazing, Color1=f0, Color2=(1, 1, 1, 1))
    return mix.outputs[0]


def image_texture(shader, spec, image):
    texture = shader.node("ShaderNodeTexImage")
    texture.image = image
    texture.interpolation = "Closest" if spec.get("nearest") else "Linear"
    return texture


def surface_of(shader, spec, color):
    kind = spec["type"]
    if kind == "diffuse":
        return shader.node("ShaderNodeBsdfDiffuse", Color=color).outputs[0]
    if kind == "metal":
        return glossy(shader, schlick_color(shader, color), spec.get("roughness", 0))
    if kind == "glass":
        node = shader.node("ShaderNodeBsdfGlass", Color=color, Roughness=0.0, IOR=spec["ior"])
        node.distribution = MIRROR
        return node.outputs[0]
    if kind == "plastic":
        fresnel = shader.node("ShaderNodeFresnel", IOR=spec.get("ior", 1.5))
        diffuse = shader.node("ShaderNodeBsdfDiffuse", Color=color)
        return shader.mix(fresnel.outputs[0], diffuse.outputs[0],
                          glossy(shader, (1, 1, 1, 1), spec["roughness"]))
    raise ValueError(f"set.json: material type '{kind}' is not known here")


def build_material(material, spec):
    """The surface that set.json describes, in place of what the importer made of the glTF."""
    images = [n.image for n in material.node_tree.nodes if n.type == "TEX_IMAGE"]
    shader = Shader(material)
    texture = image_texture(shader, spec, images[0]) if images else None
    color = texture.outputs["Color"] if "tex" in spec else (*spec["albedo"], 1)
    surface = surface_of(shader, spec, color)
    if "alpha_cutoff" in spec:
        is_hole = shader.math("LESS_THAN", texture.outputs["Alpha"], spec["alpha_cutoff"])
        hole = shader.node("ShaderNodeBsdfTransparent").outputs[0]
        surface = shader.mix(is_hole, surface, hole)
    shader.output(surface)


def import_objects(file, is_real):
    before = set(bpy.data.objects)
    bpy.ops.import_scene.gltf(filepath=str(file))  # turns Y up to Z up, as the set does
    for added in set(bpy.data.objects) - before:
        if added.type == "MESH":
            added.is_shadow_catcher = is_real


def build_world(file):
    world = bpy.data.worlds.new("environment")
    bpy.context.scene.world = world
    world.use_nodes = True
    world.node_tree.nodes.clear()
    shader = Shader(world)
    texture = shader.node("ShaderNodeTexEnvironment")
    texture.image = bpy.data.images.load(str(file))
    texture.image.colorspace_settings.name = LINEAR
    background = shader.node("ShaderNodeBackground", Color=texture.outputs["Color"])
    shader.node("ShaderNodeOutputWorld", Surface=background.outputs[0])
    world.cycles.sampling_method = "MANUAL"
    world.cycles.sample_map_resolution = texture.image.size[0]


def build_lamp(lamp):
    """A sphere of uniform radiance. Blender counts its watts as those of a Lambertian sphere's
    surface, its radiance being their number / (4 pi^2 radius^2)."""
    brightest = max(lamp["radiance"])
    data = bpy.data.lights.new("lamp", "POINT")
    data.shadow_soft_size = lamp["radius_m"]
    data.energy = 4 * math.pi**2 * lamp["radius_m"] ** 2 * brightest
    data.color = [channel / brightest for channel in lamp["radiance"]]
    if not IS_BEFORE_4:
        data.use_soft_falloff = False
    light = bpy.data.objects.new("lamp", data)
    light.location = lamp["position"]
    light.is_shadow_catcher = True  # real: it shines on the catchers alone, too
    bpy.context.scene.collection.objects.link(light)


def build_camera(observer, frame, scale):
    scene = bpy.context.scene
    width, height = observer["width"], observer["height"]
    (fx, _, cx), (_, fy, cy), _ = observer["K"]
    data = bpy.data.cameras.new("observer")
    data.sensor_fit = "HORIZONTAL"
    data.sensor_width = 36
    data.lens = fx * data.sensor_width / width
    data.clip_start, data.clip_end = 1e-3, 1e4
    # The picture's middle is at (width - 1) / 2; both shifts are in picture widths, pixels' aspect
    # aside.
    data.shift_x = ((width - 1) / 2 - cx) / width
    data.shift_y = (cy - (height - 1) / 2) / width * fx / fy
    lens = observer.get("lens")
    if lens:
        data.dof.use_dof = True
        data.dof.focus_distance = lens["focus_distance_m"]
        # Blender's f-number is over its own focal length, which the sensor's size above decides.
        data.dof.aperture_fstop = data.lens / 1000 / lens["aperture_diameter_m"]
        data.dof.aperture_blades = 0
    camera = bpy.data.objects.new("observer", data)
    pose = mathutils.Matrix(observer["poses_world_from_camera"][f"{frame:04d}"])
    camera.matrix_world = pose @ mathutils.Matrix.Diagonal((1, -1, -1, 1))
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.render.resolution_x = round(width * scale)
    scene.render.resolution_y = round(height * scale)
    scene.render.resolution_percentage = 100
    scene.render.pixel_aspect_x = max(1, fy / fx)
    scene.render.pixel_aspect_y = max(1, fx / fy)


def configure_cycles(threads):
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.threads_mode = "FIXED"
    scene.render.threads = threads
    scene.render.film_transparent = True
    scene.render.use_persistent_data = True
    scene.render.use_compositing = False
    scene.render.use_sequencer = False
    cycles = scene.cycles
    cycles.device = "CPU"
    cycles.pixel_filter_type = "BOX"
    cycles.filter_width = 1.0
    cycles.use_adaptive_sampling = False
    cycles.use_denoising = False
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0
    cycles.blur_glossy = 0
    cycles.caustics_reflective = cycles.caustics_refractive = True
    cycles.light_sampling_threshold = 0
    cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = BOUNCES
    cycles.transmission_bounces = cycles.transparent_max_bounces = BOUNCES
    bpy.context.view_layer.cycles.use_pass_shadow_catcher = True
    settings = scene.render.image_settings
    settings.file_format = "OPEN_EXR_MULTILAYER"
    settings.color_depth = "32"
    settings.exr_codec = "ZIP"


def cpu_seconds():
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime


def render(samples, seed, file):
    scene = bpy.context.scene
    scene.cycles.samples = samples
    scene.cycles.seed = seed
    scene.render.filepath = str(file)
    start = cpu_seconds()
    bpy.ops.render.render(write_still=True)
    return cpu_seconds() - start


def main():
    options = arguments()
    description = json.loads((options.directory / "set.json").read_text())
    observer = description["observer"]
    bpy.ops.wm.read_factory_settings(use_empty=True)
    import_objects(options.directory / description["gltf"]["phantom"], True)
    import_objects(options.directory / description["gltf"]["virtual"], False)
    for material in bpy.data.materials:
        # A name that both files have comes a second time as NAME.001.
        build_material(material, description["gltf"]["materials"][material.name.split(".")[0]])
    for lamp in description.get("lamps", []):
        build_lamp(lamp)
    build_world(options.directory / description["env"]["file"])
    build_camera(observer, options.frame, options.width / observer["width"])
    configure_cycles(options.threads)
    options.out.mkdir(parents=True, exist_ok=True)
    render(1, 0, options.out / "warm-up.exr")
    with open(options.out / "renders.csv", "w", newline="") as file:
        table = csv.writer(file)
        table.writerow(["samples", "cpu_s", "file"])
        for samples in map(int, options.samples.split(",")):
            name = f"{samples}.exr"
            seconds = render(samples, options.seed, options.out / name)
            table.writerow([samples, f"{seconds:.6f}", name])


main()
