# SPDX-License-Identifier: GPL-3.0-or-later
"""Stubs of gRPC's own services. They are made into a folder `grpc`, which must not hide the package of that name."""
import importlib.util
import os
import sys
from pathlib import Path

STUBS = Path(os.environ.get("STUBS", "build/release/tests/e2e/stubs"))


def load(name, path):
    spec = importlib.util.spec_from_file_location(name, STUBS / path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


health = load("grpc.health.v1.health_pb2", "grpc/health/v1/health_pb2.py")
reflection = load("grpc.reflection.v1alpha.reflection_pb2", "grpc/reflection/v1alpha/reflection_pb2.py")
for package, module in (("grpc.health", None), ("grpc.health.v1", health), ("grpc.reflection", None),
                        ("grpc.reflection.v1alpha", reflection)):
    holder = type(sys)(package)
    sys.modules[package] = holder
    if module is not None:
        setattr(holder, module.__name__.rsplit(".", 1)[1], module)
health_rpc = load("grpc.health.v1.health_pb2_grpc", "grpc/health/v1/health_pb2_grpc.py")
reflection_rpc = load("grpc.reflection.v1alpha.reflection_pb2_grpc", "grpc/reflection/v1alpha/reflection_pb2_grpc.py")
