# Debian packages by CPack: `cpack -G DEB` in a build. The programs, the shared libraries, and what a program needs to be built.
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_VENDOR drivebench)
set(CPACK_PACKAGE_CONTACT "drivebench maintainers <maintainers@drivebench.example>")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_ALL programs libraries development)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_RELEASE 1)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_ENABLE_COMPONENT_DEPENDS OFF)

set(CPACK_COMPONENT_PROGRAMS_DESCRIPTION "The programs drivebench and drivebench-server: emulated motors, amplifiers, shafts and sensors in deterministic real time,
 over TCP, CAN and Modbus, with reference controllers and identification.")
set(CPACK_DEBIAN_PROGRAMS_PACKAGE_NAME drivebench)
set(CPACK_DEBIAN_PROGRAMS_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PROGRAMS_PACKAGE_CONTROL_EXTRA
  ${CMAKE_CURRENT_LIST_DIR}/postinst ${CMAKE_CURRENT_LIST_DIR}/postrm ${CMAKE_CURRENT_LIST_DIR}/conffiles)

set(library libdrivebench${DRIVEBENCH_ABI})
# `drivebench test` and inproc: links load the bench as a library.
set(CPACK_DEBIAN_PROGRAMS_PACKAGE_DEPENDS "adduser, ${library} (= ${PROJECT_VERSION}-${CPACK_DEBIAN_PACKAGE_RELEASE})")
set(CPACK_COMPONENT_LIBRARIES_DESCRIPTION "The bench behind one C ABI: in process, or over TCP, CAN and Modbus.")
set(CPACK_DEBIAN_LIBRARIES_PACKAGE_NAME ${library})
set(CPACK_DEBIAN_LIBRARIES_PACKAGE_SECTION libs)
# inproc: addresses name the benches of the programs' package.
set(CPACK_DEBIAN_LIBRARIES_PACKAGE_RECOMMENDS drivebench)

set(CPACK_COMPONENT_DEVELOPMENT_DESCRIPTION "Headers for C and C++, the static library, and the files for CMake and pkg-config.")
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_NAME libdrivebench-dev)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS "${library} (= ${PROJECT_VERSION}-${CPACK_DEBIAN_PACKAGE_RELEASE})")

# The unit of the packages starts the program and the bench file that they install.
file(READ ${PROJECT_SOURCE_DIR}/configs/systemd/drivebench-server.service unit)
string(REPLACE "/usr/local/bin/drivebench-server /etc/drivebench/benches/servo-realtime.toml"
  "/usr/bin/drivebench-server /etc/drivebench/bench.toml" unit "${unit}")
file(CONFIGURE OUTPUT packages/drivebench-server.service CONTENT "${unit}" @ONLY)
file(READ ${PROJECT_SOURCE_DIR}/configs/benches/servo-realtime.toml bench)
string(REPLACE "../motors/" "/usr/share/drivebench/motors/" bench "${bench}")
file(CONFIGURE OUTPUT packages/bench.toml CONTENT "${bench}" @ONLY)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/packages/drivebench-server.service DESTINATION lib/systemd/system
  COMPONENT programs EXCLUDE_FROM_ALL)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/packages/bench.toml DESTINATION /etc/drivebench
  COMPONENT programs EXCLUDE_FROM_ALL)
foreach(pair programs:drivebench libraries:${library} development:libdrivebench-dev)
  string(REPLACE ":" ";" pair ${pair})
  list(GET pair 0 component)
  list(GET pair 1 package)
  install(FILES ${PROJECT_SOURCE_DIR}/configs/packages/copyright ${PROJECT_SOURCE_DIR}/CHANGELOG.md
    DESTINATION share/doc/${package} COMPONENT ${component} EXCLUDE_FROM_ALL)
endforeach()
include(CPack)
