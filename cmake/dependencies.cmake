# Everything from outside, versions of Debian 12 or later.
find_package(Threads REQUIRED)
find_package(TBB REQUIRED)
find_package(PkgConfig REQUIRED)
pkg_check_modules(ZSTD REQUIRED IMPORTED_TARGET libzstd)
find_path(XXHASH_INCLUDE_DIR xxhash.h REQUIRED)  # header only
find_path(NANOFLANN_INCLUDE_DIR nanoflann.hpp REQUIRED)

if(MAPCODEC_PAPER_ENCODER)
  # Not PCL's io component: it drags in VTK, Qt and MPI.
  find_package(Eigen3 REQUIRED NO_MODULE)
  find_package(Boost REQUIRED)
  pkg_search_module(PCL_COMMON REQUIRED IMPORTED_TARGET pcl_common pcl_common-1.13)
  pkg_search_module(PCL_SAC REQUIRED IMPORTED_TARGET pcl_sample_consensus pcl_sample_consensus-1.13)
  find_package(CGAL REQUIRED)
endif()
if(MAPCODEC_OCTOMAP)
  # By name: OctoMap's own targets have no namespace and carry no include folder.
  find_library(MAPCODEC_OCTOMAP_LIBRARY octomap REQUIRED)
  find_library(MAPCODEC_OCTOMATH_LIBRARY octomath REQUIRED)
  find_path(OCTOMAP_INCLUDE_DIR octomap/OcTree.h REQUIRED)
endif()
if(MAPCODEC_BUILD_TOOLS)
  find_package(CLI11 REQUIRED)
  find_package(spdlog REQUIRED)
  find_package(nlohmann_json REQUIRED)
  find_package(PNG REQUIRED)
endif()
