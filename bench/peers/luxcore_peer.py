#!/usr/bin/env python3
"""Renders an exported scene with LuxCore, as long as the time allows."""

import os
import time

import numpy as np
import pyluxcore
from PIL import Image

from peer import Peer, is_lamp

PATH_DEPTH = 64


def main():
    peer = Peer(__doc__)
    pyluxcore.Init(lambda message: None)
    scene = pyluxcore.Scene()
    scene.Parse(scene_of(peer, scene))
    session = pyluxcore.RenderSession(pyluxcore.RenderConfig(config_of(peer), scene))
    session.Start()
    while not is_done(peer, session):
        time.sleep(0.01)
    # The end of the session waits for its threads; the picture does not need them.
    session.Pause()
    film = session.GetFilm()
    if peer.options.denoise:
        kind = pyluxcore.FilmOutputType.RGB_IMAGEPIPELINE
    else:
        kind = pyluxcore.FilmOutputType.RGB
    film.SaveOutput(str(peer.options.out), kind, pyluxcore.Properties())


def scene_of(peer, scene):
    camera = peer.camera
    props = pyluxcore.Properties()

    def put(name, *values):
        props.Set(pyluxcore.Property(name, list(values)))

    put("scene.camera.type", "perspective")
    put("scene.camera.lookat.orig", *camera["eye"])
    put("scene.camera.lookat.target", *camera["look_at"])
    put("scene.camera.up", *camera["up"])
    # The angle of the shorter side, which is the height in all our pictures.
    put("scene.camera.fieldofview", camera["vertical_fov_degrees"])
    # Its rows lie one lower than everybody else's.
    aspect, row = peer.width / peer.height, 2 / peer.height
    put("scene.camera.screenwindow", -aspect, aspect, -1 - row, 1 - row)
    put("scene.camera.autovolume.enable", False)
    for number, mesh in enumerate(peer.meshes):
        material, shape = f"material{number}", f"shape{number}"
        put(f"scene.materials.{material}.type", "matte")
        albedo = mesh["albedo"]
        if "constant" in albedo:
            put(f"scene.materials.{material}.kd", *albedo["constant"])
        else:
            texture = f"texture{number}"
            define_image(scene, texture, peer.file(albedo["texture"]["file"]))
            put(f"scene.textures.{texture}.type", "imagemap")
            put(f"scene.textures.{texture}.file", texture)
            put(f"scene.textures.{texture}.gamma", 1.0)
            put(f"scene.textures.{texture}.wrap", "clamp" if albedo["texture"]["clamp"] else "repeat")
            # v upwards, as in the PLY.
            put(f"scene.textures.{texture}.mapping.type", "uvmapping2d")
            put(f"scene.textures.{texture}.mapping.uvscale", 1.0, -1.0)
            put(f"scene.materials.{material}.kd", texture)
        if is_lamp(mesh):
            put(f"scene.materials.{material}.emission", *mesh["emission"])
        put(f"scene.shapes.{shape}.type", "mesh")
        put(f"scene.shapes.{shape}.ply", peer.file(mesh["file"]))
        put(f"scene.objects.object{number}.shape", shape)
        put(f"scene.objects.object{number}.material", material)
    return props


def define_image(scene, name, path):
    """Hands over an sRGB picture in linear light; the program itself knows powers only."""
    codes = np.arange(256) / 255
    linear = np.where(codes <= 0.04045, codes / 12.92, ((codes + 0.055) / 1.055) ** 2.4).astype(np.float32)
    with Image.open(path) as picture:
        texels = linear[np.asarray(picture.convert("RGB"))]
    height, width, channels = texels.shape
    scene.DefineImageMap(name, np.ascontiguousarray(texels).ravel(), 1.0, channels, width, height)


def config_of(peer):
    props = pyluxcore.Properties()
    settings = {
        "film.width": peer.width,
        "film.height": peer.height,
        "film.filter.type": "BOX",
        "film.filter.width": 0.5,
        "film.imagepipelines.0.0.type": "NOP",
        "renderengine.type": "PATHCPU",
        "renderengine.seed": peer.options.seed + 1,
        "native.threads.count": peer.threads,
        "path.pathdepth.total": PATH_DEPTH,
        "path.pathdepth.diffuse": PATH_DEPTH,
        "sampler.type": "SOBOL",
        "scene.epsilon.min": 1e-5,
    }
    if peer.options.denoise:
        settings |= {
            "film.imagepipelines.0.0.type": "INTEL_OIDN",
            "film.imagepipelines.0.0.prefilter.enable": False,
        }
        for number, kind in enumerate(["ALBEDO", "AVG_SHADING_NORMAL"]):
            settings[f"film.outputs.{number}.type"] = kind
            settings[f"film.outputs.{number}.filename"] = f"{kind}.exr"
    for name, value in settings.items():
        props.Set(pyluxcore.Property(name, value))
    return props


def is_done(peer, session):
    if peer.options.seconds:
        return peer.left() <= 0
    session.UpdateStats()
    return session.GetStats().Get("stats.renderengine.pass").GetInt() >= peer.options.spp


if __name__ == "__main__":
    main()
    # Tearing down takes time that nobody asked for.
    os._exit(0)
