#!/usr/bin/env python3
"""Renders an exported scene with Blender's Cycles, as long as the time allows."""

import os

import bpy
import mathutils
import numpy as np

from peer import Peer, is_lamp

PATH_DEPTH = 64
SAMPLES_MAX = 1 << 20


def main():
    peer = Peer(__doc__)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    add_camera(peer, scene)
    for number, mesh in enumerate(peer.meshes):
        add_mesh(peer, scene, number, mesh)
    settle(peer, scene)
    bpy.ops.render.render(write_still=True)


def add_camera(peer, scene):
    pose = peer.camera
    camera = bpy.data.cameras.new("camera")
    camera.sensor_fit = "VERTICAL"
    camera.angle = np.radians(pose["vertical_fov_degrees"])
    camera.clip_start, camera.clip_end = 1e-3, 1e6
    holder = bpy.data.objects.new("camera", camera)
    eye, look_at, up = (mathutils.Vector(pose[name]) for name in ("eye", "look_at", "up"))
    back = (eye - look_at).normalized()
    right = up.cross(back).normalized()
    rotation = mathutils.Matrix((right, back.cross(right), back)).transposed().to_4x4()
    holder.matrix_world = mathutils.Matrix.Translation(eye) @ rotation
    scene.collection.objects.link(holder)
    scene.camera = holder


def add_mesh(peer, scene, number, description):
    corners, faces = read_ply(peer.file(description["file"]))
    mesh = bpy.data.meshes.new(f"mesh{number}")
    mesh.vertices.add(len(corners))
    mesh.vertices.foreach_set("co", corners[:, 0:3].ravel())
    mesh.loops.add(3 * faces)
    mesh.loops.foreach_set("vertex_index", np.arange(3 * faces, dtype=np.int32))
    mesh.polygons.add(faces)
    mesh.polygons.foreach_set("loop_start", 3 * np.arange(faces, dtype=np.int32))
    uvs = mesh.uv_layers.new(name="uv")
    uvs.data.foreach_set("uv", corners[:, 6:8].ravel())
    mesh.update()
    mesh.normals_split_custom_set_from_vertices(corners[:, 3:6])
    mesh.materials.append(material_of(peer, number, description))
    scene.collection.objects.link(bpy.data.objects.new(f"object{number}", mesh))


def read_ply(path):
    """Corners `[3 × faces][8]`, three to a face, as `eval export` writes them."""
    content = open(path, "rb").read()
    header, _, body = content.partition(b"end_header\n")
    faces = int(header.split(b"element face ")[1].split()[0])
    return np.frombuffer(body, "<f4", 24 * faces).reshape(-1, 8), faces


def material_of(peer, number, description):
    material = bpy.data.materials.new(f"material{number}")
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    output = nodes.new("ShaderNodeOutputMaterial")
    diffuse = nodes.new("ShaderNodeBsdfDiffuse")
    albedo = description["albedo"]
    if "constant" in albedo:
        diffuse.inputs["Color"].default_value = (*albedo["constant"], 1.0)
    else:
        texture = nodes.new("ShaderNodeTexImage")
        texture.image = bpy.data.images.load(peer.file(albedo["texture"]["file"]))
        texture.extension = "EXTEND" if albedo["texture"]["clamp"] else "REPEAT"
        links.new(texture.outputs["Color"], diffuse.inputs["Color"])
    if not is_lamp(description):
        links.new(diffuse.outputs[0], output.inputs["Surface"])
        return material
    # Shines to the front only.
    emission = nodes.new("ShaderNodeEmission")
    emission.inputs["Color"].default_value = (*description["emission"], 1.0)
    both = nodes.new("ShaderNodeAddShader")
    links.new(diffuse.outputs[0], both.inputs[0])
    links.new(emission.outputs[0], both.inputs[1])
    side = nodes.new("ShaderNodeMixShader")
    links.new(nodes.new("ShaderNodeNewGeometry").outputs["Backfacing"], side.inputs["Fac"])
    links.new(both.outputs[0], side.inputs[1])
    links.new(diffuse.outputs[0], side.inputs[2])
    links.new(side.outputs[0], output.inputs["Surface"])
    return material


def settle(peer, scene):
    scene.render.engine = "CYCLES"
    cycles = scene.cycles
    cycles.device = "CPU"
    cycles.samples = peer.options.spp or SAMPLES_MAX
    cycles.use_adaptive_sampling = False
    cycles.seed = peer.options.seed
    cycles.max_bounces = cycles.diffuse_bounces = PATH_DEPTH
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0.0
    cycles.blur_glossy = 0.0
    cycles.caustics_reflective = cycles.caustics_refractive = False
    cycles.pixel_filter_type = "BOX"
    cycles.use_denoising = peer.options.denoise
    cycles.denoiser = "OPENIMAGEDENOISE"
    render = scene.render
    render.threads_mode, render.threads = "FIXED", peer.threads
    render.resolution_x, render.resolution_y = peer.width, peer.height
    render.resolution_percentage = 100
    render.image_settings.file_format = "OPEN_EXR"
    render.image_settings.color_depth = "32"
    render.filepath = str(peer.options.out.resolve())
    render.use_persistent_data = False
    if peer.options.seconds:
        cycles.time_limit = max(peer.left(), 0.05)


if __name__ == "__main__":
    main()
    # Tearing down takes time that nobody asked for.
    os._exit(0)
