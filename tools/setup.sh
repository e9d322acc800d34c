#!/bin/bash
# Installs what the build needs on Debian 12. Does nothing when all of it is there.
# Usage: tools/setup.sh [fuzz]        "fuzz" adds Clang for the libFuzzer targets.
set -euo pipefail

packages=(
  g++ cmake ninja-build ccache pkg-config                                   # to build
  libtbb-dev libzstd-dev libxxhash-dev libnanoflann-dev libeigen3-dev zlib1g-dev  # libraries
  libmrpt-maps-dev libmrpt-slam-dev liboctomap-dev                          # MRPT's logs and maps, octrees of OctoMap
  libcgal-dev libgmp-dev libmpfr-dev libpcl-dev                             # the 2014 paper's encoder, test oracles
  libgrpc++-dev libprotobuf-dev protobuf-compiler-grpc protobuf-compiler    # the map service
  libsqlite3-dev libssl-dev libbrotli-dev libcpp-httplib-dev prometheus-cpp-dev libtomlplusplus-dev libsystemd-dev  # its catalogue, HTTP, figures
  libcli11-dev libspdlog-dev nlohmann-json3-dev libpng-dev                  # the programs
  libdraco-dev gnuplot-nox zstd xz-utils                                    # what the benchmarks compare with and draw
  liblz4-dev libbz2-dev libpugixml-dev libyaml-cpp-dev                      # ROS bags, E57, Autoware's metadata
  libgtest-dev python3 librosbag-storage-dev python3-grpcio grpc-proto python3-prometheus-client curl openssl mrpt-common  # tests
)
[[ "${1:-}" == fuzz ]] && packages+=(clang-14 libclang-rt-14-dev)

if ! command -v dpkg-query >/dev/null; then
  echo "setup: this is not Debian, so nothing is installed. Needed (Debian's names): ${packages[*]}" >&2
  exit 0
fi

missing=()
for package in "${packages[@]}"; do
  state=$(dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null || true)
  [[ "$state" == installed* ]] || missing+=("$package")
done
[[ ${#missing[@]} -eq 0 ]] && exit 0

root=()
if [[ $(id -u) -ne 0 ]]; then
  command -v sudo >/dev/null || { echo "setup: become root and run: apt-get install --no-install-recommends ${missing[*]}" >&2; exit 1; }
  root=(sudo)
fi
apt=("${root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -y -qq -o DPkg::Lock::Timeout=600 -o Acquire::Retries=3)

echo "setup: installing ${missing[*]}" >&2
log=$(mktemp)
trap 'rm -f "$log"' EXIT
install() { "${apt[@]}" install --no-install-recommends "${missing[@]}" </dev/null >"$log" 2>&1; }
# The package lists may be missing (a fresh container) or old (a file named there is gone): fetch them when it shows.
if ! install; then
  "${apt[@]}" update </dev/null >&2
  install || { tail -n 30 "$log" >&2; echo "setup: apt-get install failed" >&2; exit 1; }
fi
