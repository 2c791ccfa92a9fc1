# Sourced by the other scripts, from the root of the project.
# A python3 from elsewhere on PATH breaks catkin's and pluginlib's CMake helpers.
export PATH="/usr/bin:$PATH"
export LC_ALL=C.UTF-8
: "${SCANNER_BUILD:=$PWD/build}"
: "${SCANNER_DATA:=$PWD/../shared/data}"
export SCANNER_BUILD SCANNER_DATA
