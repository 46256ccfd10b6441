# The packages of one build: the daemon, the laboratory, the headers, the Python reader, the web page, the bridges. Every install() without a COMPONENT is the daemon's.
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME tactiled)
set(CPACK_PACKAGE_VERSION ${PROJECT_VERSION})
# Set your own address in packages for others; example.org is a placeholder.
set(TACTILED_CONTACT "tactiled contributors <tactiled@example.org>" CACHE STRING "Maintainer of the Debian packages")
set(CPACK_PACKAGE_CONTACT "${TACTILED_CONTACT}")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_ENABLE_COMPONENT_DEPENDS OFF)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_COMPONENTS_ALL Unspecified lab dev python)
if(TARGET tactiled-web)
    list(APPEND CPACK_COMPONENTS_ALL web)
endif()

set(CPACK_DEBIAN_UNSPECIFIED_PACKAGE_NAME tactiled)
set(CPACK_DEBIAN_UNSPECIFIED_PACKAGE_SECTION science)
set(CPACK_DEBIAN_UNSPECIFIED_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_UNSPECIFIED_PACKAGE_DEPENDS "systemd | systemd-standalone-sysusers, init-system-helpers (>= 1.54~)")
set(CPACK_DEBIAN_UNSPECIFIED_PACKAGE_SUGGESTS "tactiled-lab, tactiled-web, python3-tactiled, libtactiled-dev, i2c-tools, mbpoll")
set(CPACK_COMPONENT_UNSPECIFIED_DESCRIPTION "daemon for the tactile sensors of a robot gripper
It reads tactile sensors over serial ports, CAN, I2C and Modbus, turns
their channels into forces with their uncertainty, and shows them to
programs through shared memory and to a PLC through Modbus.
It is not a safety function.")

# The versions must be equal, because both packages contain one table of verbs.
set(CPACK_DEBIAN_LAB_PACKAGE_NAME tactiled-lab)
set(CPACK_DEBIAN_LAB_PACKAGE_SECTION science)
set(CPACK_DEBIAN_LAB_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_LAB_PACKAGE_DEPENDS "tactiled (= ${PROJECT_VERSION})")
set(CPACK_COMPONENT_LAB_DESCRIPTION "calibration and simulation of tactile sensors for tactiled
It adds the verbs of tactilectl that fit calibrations to recordings, turn
recordings into forces, simulate sensors and compare methods.
A computer that only runs tactiled does without.")

set(CPACK_DEBIAN_DEV_PACKAGE_NAME libtactiled-dev)
set(CPACK_DEBIAN_DEV_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEV_PACKAGE_ARCHITECTURE all)
set(CPACK_COMPONENT_DEV_DESCRIPTION "read the forces of tactiled in C and C++
Headers alone, for C11 and C++17, with their pkg-config and CMake files:
nothing to link.")

set(CPACK_DEBIAN_PYTHON_PACKAGE_NAME python3-tactiled)
set(CPACK_DEBIAN_PYTHON_PACKAGE_SECTION python)
set(CPACK_DEBIAN_PYTHON_PACKAGE_ARCHITECTURE all)
set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS python3)
set(CPACK_COMPONENT_PYTHON_DESCRIPTION "read the forces of tactiled in Python
One module, which needs Python's standard library alone.")

set(CPACK_DEBIAN_WEB_PACKAGE_NAME tactiled-web)
set(CPACK_DEBIAN_WEB_PACKAGE_SECTION science)
set(CPACK_DEBIAN_WEB_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_WEB_PACKAGE_DEPENDS "tactiled (= ${PROJECT_VERSION})")
set(CPACK_COMPONENT_WEB_DESCRIPTION "web page and metrics of the tactile sensor daemon
It shows the forces, their uncertainty and quality, the grasp and the
faults of tactiled in a browser, and as metrics for Prometheus and JSON.
It reads shared memory; a crash of it does not concern the daemon.")

foreach(component ${bridges})
    string(TOUPPER ${component} upper)
    list(APPEND CPACK_COMPONENTS_ALL ${component})
    set(CPACK_DEBIAN_${upper}_PACKAGE_NAME tactiled-${component})
    set(CPACK_DEBIAN_${upper}_PACKAGE_SECTION science)
    set(CPACK_DEBIAN_${upper}_PACKAGE_SHLIBDEPS ON)
    set(CPACK_DEBIAN_${upper}_PACKAGE_DEPENDS "tactiled (= ${PROJECT_VERSION})")
endforeach()
set(CPACK_COMPONENT_RDT_DESCRIPTION "forces of tactiled as the stream of an ATI Net F/T
It sends the forces of a tactile sensor by UDP as the force-torque sensor
Net F/T does (RDT), so that robot programs for that device read them.")
set(CPACK_COMPONENT_MQTT_DESCRIPTION "forces of tactiled to an MQTT broker
It publishes the forces, their quality and the grasp of a gripper as JSON
messages, with retained state, last will and TLS.")
set(CPACK_COMPONENT_DDS_DESCRIPTION "forces of tactiled as topics of ROS 2
It publishes geometry_msgs/WrenchStamped for each tactile sensor, and
diagnostics, by Cyclone DDS. ROS itself is not needed.")

set(scripts ${CMAKE_CURRENT_LIST_DIR})
# A program that is not enabled by itself, with the same scripts for each.
foreach(component web ${bridges})
    string(TOUPPER ${component} upper)
    set(PROGRAM tactiled-${component})
    set(made)
    foreach(script postinst prerm postrm)
        configure_file(${scripts}/reader/${script} ${component}/${script} @ONLY)
        list(APPEND made ${CMAKE_CURRENT_BINARY_DIR}/${component}/${script})
    endforeach()
    set(CPACK_DEBIAN_${upper}_PACKAGE_CONTROL_EXTRA ${made})
endforeach()
set(CPACK_DEBIAN_UNSPECIFIED_PACKAGE_CONTROL_EXTRA ${scripts}/postinst ${scripts}/prerm ${scripts}/postrm)

# Debian requires these files in the documentation folder of each package.
configure_file(debian/changelog changelog @ONLY)
add_custom_command(OUTPUT changelog.gz DEPENDS ${CMAKE_CURRENT_BINARY_DIR}/changelog VERBATIM
    COMMAND sh -c "gzip -9nc changelog > changelog.gz")
add_custom_target(debian_changelog ALL DEPENDS changelog.gz)
add_dependencies(manual_pages debian_changelog)
set(pairs "tactiled Unspecified" "tactiled-lab lab" "libtactiled-dev dev" "python3-tactiled python")
if(TARGET tactiled-web)
    list(APPEND pairs "tactiled-web web")
endif()
foreach(component ${bridges})
    list(APPEND pairs "tactiled-${component} ${component}")
endforeach()
foreach(pair ${pairs})
    separate_arguments(pair)
    list(GET pair 0 package)
    list(GET pair 1 component)
    install(FILES ${scripts}/copyright ${CMAKE_CURRENT_BINARY_DIR}/changelog.gz DESTINATION ${doc}/${package} COMPONENT ${component})
endforeach()
include(CPack)
set(bridge_targets ${bridges})
list(TRANSFORM bridge_targets PREPEND tactiled-)
# Not CPack's own target `package`: that builds every test first.
add_custom_target(deb COMMAND ${CMAKE_CPACK_COMMAND} --config ${CMAKE_BINARY_DIR}/CPackConfig.cmake -B ${CMAKE_BINARY_DIR}/deb
    DEPENDS tactiled tactilectl $<$<TARGET_EXISTS:tactiled-web>:tactiled-web> ${bridge_targets} manual_pages USES_TERMINAL VERBATIM)
