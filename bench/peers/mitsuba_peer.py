#!/usr/bin/env python3
"""Renders an exported scene with Mitsuba 3 (llvm), as long as the time allows."""

import glob
import os
import time

import numpy as np

from peer import Peer, is_lamp

# Debian has LLVM without the plain name that Dr.Jit looks for; 14 is too old for it.
libraries = glob.glob("/usr/lib/x86_64-linux-gnu/libLLVM-[0-9][0-9].so")
if libraries:
    os.environ.setdefault("DRJIT_LIBLLVM_PATH", max(libraries))

import mitsuba as mi  # noqa: E402

mi.set_variant("llvm_ad_rgb")

PATH_DEPTH = 64
# A pass must be long enough to be worth its start and short enough to end in time.
PASS_SECONDS = 0.5


def main():
    peer = Peer(__doc__)
    scene = mi.load_dict(scene_of(peer))
    light, features = render(peer, scene)
    if peer.options.denoise:
        light = denoised(light, features)
    mi.Bitmap(light).write(str(peer.options.out))


def scene_of(peer):
    camera = peer.camera
    scene = {
        "type": "scene",
        "integrator": {
            "type": "aov",
            "aovs": "albedo:albedo,normal:sh_normal",
            "path": {"type": "path", "max_depth": PATH_DEPTH, "rr_depth": 5},
        }
        if peer.options.denoise
        else {"type": "path", "max_depth": PATH_DEPTH, "rr_depth": 5},
        "sensor": {
            "type": "perspective",
            "fov": camera["vertical_fov_degrees"],
            "fov_axis": "y",
            "near_clip": 1e-3,
            "far_clip": 1e6,
            "to_world": mi.ScalarTransform4f().look_at(camera["eye"], camera["look_at"], camera["up"]),
            "film": {
                "type": "hdrfilm",
                "width": peer.width,
                "height": peer.height,
                "pixel_format": "rgb",
                "component_format": "float32",
                "rfilter": {"type": "box"},
            },
            "sampler": {"type": "independent"},
        },
    }
    for number, mesh in enumerate(peer.meshes):
        shape = {
            "type": "ply",
            "filename": peer.file(mesh["file"]),
            "bsdf": {"type": "twosided", "inner": {"type": "diffuse", "reflectance": reflectance(peer, mesh["albedo"])}},
        }
        if is_lamp(mesh):
            shape["emitter"] = {"type": "area", "radiance": {"type": "rgb", "value": mesh["emission"]}}
        scene[f"shape{number}"] = shape
    return scene


def reflectance(peer, albedo):
    if "constant" in albedo:
        return {"type": "rgb", "value": albedo["constant"]}
    texture = albedo["texture"]
    return {
        "type": "bitmap",
        "filename": peer.file(texture["file"]),
        "filter_type": "bilinear",
        "wrap_mode": "clamp" if texture["clamp"] else "repeat",
    }


def render(peer, scene):
    """The mean of passes: RGB, and albedo and normals if they are wanted."""
    seeds = iter(range(peer.options.seed << 16, (peer.options.seed + 1) << 16))
    spp = min(peer.options.spp or 1, 16)
    total, weight = 0.0, 0
    while True:
        begun = time.monotonic()
        total = total + spp * np.array(mi.render(scene, spp=spp, seed=next(seeds)), dtype=np.float64)
        weight += spp
        took = time.monotonic() - begun
        if peer.options.spp:
            if weight >= peer.options.spp:
                break
            spp = min(spp, peer.options.spp - weight)
            continue
        # The first pass compiles: what it took says little of the next.
        left = peer.left()
        if weight > 1:
            spp = max(1, int(spp * min(PASS_SECONDS, left) / took))
            if left < took / 2 and spp * took > left:
                break
        if left <= 0.05:
            break
    mean = (total / weight).astype(np.float32)
    return np.ascontiguousarray(mean[..., :3]), mean[..., 3:]


def denoised(light, features):
    from pyoidn import denoise

    albedo = np.ascontiguousarray(features[..., :3])
    normal = np.ascontiguousarray(features[..., 3:6])
    return np.ascontiguousarray(denoise(light, albedo=albedo, normal=normal, hdr=True))


if __name__ == "__main__":
    main()
    # Tearing down takes time that nobody asked for.
    os._exit(0)
