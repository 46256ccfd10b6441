# Cross-builds for arm64 with Debian's compiler; what is built runs here through qemu-user.
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(CMAKE_C_COMPILER aarch64-linux-gnu-gcc)
set(CMAKE_CXX_COMPILER aarch64-linux-gnu-g++)
set(CMAKE_LIBRARY_ARCHITECTURE aarch64-linux-gnu)
set(ENV{PKG_CONFIG_LIBDIR} /usr/lib/aarch64-linux-gnu/pkgconfig:/usr/share/pkgconfig)
# termios2.c, compiled by build.sh, stands in for two calls that qemu-user 7.2 does not know.
set(CMAKE_CROSSCOMPILING_EMULATOR qemu-aarch64-static -E LD_PRELOAD=${CMAKE_CURRENT_LIST_DIR}/../../build/termios2.so)
