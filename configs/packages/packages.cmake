# Debian packages by CPack: `cpack -G DEB` in a build. The server, the tools, the benches, the shared libraries, what a
# program needs to be built, the Python package, and the documents. A test holds them against lintian.
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_VENDOR drivebench)
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "") # each package has its own, the first line of its description
set(CPACK_PACKAGE_CONTACT "drivebench maintainers <maintainers@drivebench.example>")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_ALL server tools data libraries development python documentation)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_RELEASE 2)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_GENERATE_SHLIBS ON)
set(CPACK_DEBIAN_PACKAGE_GENERATE_SHLIBS_POLICY ">=")
set(CPACK_DEBIAN_ENABLE_COMPONENT_DEPENDS OFF)

set(library libdrivebench${DRIVEBENCH_ABI})
set(this_build "(= ${PROJECT_VERSION}-${CPACK_DEBIAN_PACKAGE_RELEASE})")
set(this_library "${library} ${this_build}")
set(these_benches "drivebench-data ${this_build}")
set(all_in_one "drivebench (<< 0.1.0-2)") # drivebench had the server and the benches, too, before 0.1.0-2
set(control ${CMAKE_CURRENT_LIST_DIR})

set(CPACK_COMPONENT_SERVER_DESCRIPTION "test bench for electric drives, the server
Emulated motors, amplifiers, shafts and sensors in deterministic real time,
over TCP, CAN and Modbus, as a program and as a service.")
set(CPACK_DEBIAN_SERVER_PACKAGE_NAME drivebench-server)
set(CPACK_DEBIAN_SERVER_PACKAGE_SECTION science)
set(CPACK_DEBIAN_SERVER_PACKAGE_CONTROL_EXTRA ${control}/server/postinst ${control}/server/postrm ${control}/server/conffiles)
set(CPACK_DEBIAN_SERVER_PACKAGE_DEPENDS "adduser, ${these_benches}")
set(CPACK_DEBIAN_SERVER_PACKAGE_RECOMMENDS logrotate)
set(CPACK_DEBIAN_SERVER_PACKAGE_BREAKS "${all_in_one}")
set(CPACK_DEBIAN_SERVER_PACKAGE_REPLACES "${all_in_one}")

set(CPACK_COMPONENT_TOOLS_DESCRIPTION "test bench in software for the controllers of electric drives
The program drivebench: reference controllers, identification, regression
tests, recordings and a page for the browser, with a bench of this computer
or of another one.")
set(CPACK_DEBIAN_TOOLS_PACKAGE_NAME drivebench)
set(CPACK_DEBIAN_TOOLS_PACKAGE_SECTION science)
# `drivebench test` and inproc: links load the bench as a library.
set(CPACK_DEBIAN_TOOLS_PACKAGE_DEPENDS "${these_benches}, ${this_library}")
set(CPACK_DEBIAN_TOOLS_PACKAGE_RECOMMENDS drivebench-server) # `drivebench serve` and `drivebench demo`
set(CPACK_DEBIAN_TOOLS_PACKAGE_SUGGESTS drivebench-doc)

set(CPACK_COMPONENT_DATA_DESCRIPTION "test bench for electric drives, benches and motors
The benches, motors, experiments and suites of regression tests that the
programs and the library know by name.")
set(CPACK_DEBIAN_DATA_PACKAGE_NAME drivebench-data)
set(CPACK_DEBIAN_DATA_PACKAGE_SECTION science)
set(CPACK_DEBIAN_DATA_PACKAGE_ARCHITECTURE all)
set(CPACK_DEBIAN_DATA_PACKAGE_BREAKS "${all_in_one}")
set(CPACK_DEBIAN_DATA_PACKAGE_REPLACES "${all_in_one}")

set(CPACK_COMPONENT_LIBRARIES_DESCRIPTION "test bench for electric drives, the libraries
The bench behind one C ABI: in the process of its controller, or over TCP, CAN
and Modbus, with the same samples to the bit.")
set(CPACK_DEBIAN_LIBRARIES_PACKAGE_NAME ${library})
set(CPACK_DEBIAN_LIBRARIES_PACKAGE_SECTION libs)
set(CPACK_DEBIAN_LIBRARIES_PACKAGE_MULTIARCH same)
set(CPACK_DEBIAN_LIBRARIES_PACKAGE_CONTROL_EXTRA ${control}/libraries/triggers)
set(CPACK_DEBIAN_LIBRARIES_PACKAGE_RECOMMENDS drivebench-data) # inproc: addresses name benches

set(CPACK_COMPONENT_DEVELOPMENT_DESCRIPTION "test bench for electric drives, to build programs with
Headers for C and C++, the static library, and the files by which CMake and
pkg-config find the bench behind one C ABI.")
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_NAME libdrivebench-dev)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS "${this_library}")

set(CPACK_COMPONENT_PYTHON_DESCRIPTION "test bench for electric drives, from Python
The package drivebench: benches in process or over a network, recordings, and
arrays of NumPy and pandas where they are installed.")
set(CPACK_DEBIAN_PYTHON_PACKAGE_NAME python3-drivebench)
set(CPACK_DEBIAN_PYTHON_PACKAGE_SECTION python)
set(CPACK_DEBIAN_PYTHON_PACKAGE_ARCHITECTURE all)
set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS "python3 (>= 3.11), ${this_library}")
set(CPACK_DEBIAN_PYTHON_PACKAGE_RECOMMENDS "drivebench-data, drivebench-server") # benches by name, drivebench.serve()
set(CPACK_DEBIAN_PYTHON_PACKAGE_SUGGESTS "python3-numpy, python3-pandas")
set(CPACK_DEBIAN_PYTHON_PACKAGE_CONTROL_EXTRA ${control}/python/postinst ${control}/python/prerm)

set(CPACK_COMPONENT_DOCUMENTATION_DESCRIPTION "test bench for electric drives, the documents
What is modelled and how exactly, every wire and file format, every command,
how a bench is kept in operation, and examples in C, C++ and Python.")
set(CPACK_DEBIAN_DOCUMENTATION_PACKAGE_NAME drivebench-doc)
set(CPACK_DEBIAN_DOCUMENTATION_PACKAGE_SECTION doc)
set(CPACK_DEBIAN_DOCUMENTATION_PACKAGE_ARCHITECTURE all)
set(CPACK_DEBIAN_DOCUMENTATION_PACKAGE_SUGGESTS drivebench)

set(made ${CMAKE_CURRENT_BINARY_DIR}/packages)

# The unit of the packages starts the program and the bench file that they install.
file(READ ${PROJECT_SOURCE_DIR}/configs/systemd/drivebench-server.service unit)
string(REPLACE "/usr/local/bin/drivebench-server /etc/drivebench/benches/servo-realtime.toml"
  "/usr/bin/drivebench-server /etc/drivebench/bench.toml" unit "${unit}")
file(CONFIGURE OUTPUT packages/drivebench-server.service CONTENT "${unit}" @ONLY)
file(READ ${PROJECT_SOURCE_DIR}/configs/benches/servo-realtime.toml bench)
string(REPLACE "../motors/" "/usr/share/drivebench/motors/" bench "${bench}")
file(CONFIGURE OUTPUT packages/bench.toml CONTENT "${bench}" @ONLY)
install(FILES ${made}/drivebench-server.service DESTINATION lib/systemd/system COMPONENT server EXCLUDE_FROM_ALL)
install(FILES ${made}/bench.toml DESTINATION /etc/drivebench COMPONENT server EXCLUDE_FROM_ALL)
install(FILES ${control}/server/logrotate DESTINATION /etc/logrotate.d RENAME drivebench-server COMPONENT server EXCLUDE_FROM_ALL)

# pip has its own way to install the Python package; this one is for the interpreter of the system.
file(STRINGS ${PROJECT_SOURCE_DIR}/clients/python/pyproject.toml summary REGEX "^description = ")
file(STRINGS ${PROJECT_SOURCE_DIR}/clients/python/pyproject.toml requires REGEX "^requires-python = ")
string(REGEX REPLACE "^[^\"]*\"([^\"]*)\".*" "\\1" summary "${summary}")
string(REGEX REPLACE "^[^\"]*\"([^\"]*)\".*" "\\1" requires "${requires}")
configure_file(${control}/python/METADATA.in packages/METADATA @ONLY)
set(modules lib/python3/dist-packages)
install(DIRECTORY ${PROJECT_SOURCE_DIR}/clients/python/src/drivebench DESTINATION ${modules}
  COMPONENT python EXCLUDE_FROM_ALL FILES_MATCHING PATTERN "*.py" PATTERN py.typed PATTERN __pycache__ EXCLUDE)
file(CONFIGURE OUTPUT packages/entry_points.txt CONTENT "[pytest11]\ndrivebench = drivebench.pytest_plugin\n" @ONLY)
install(FILES ${made}/METADATA ${made}/entry_points.txt DESTINATION ${modules}/drivebench-${PROJECT_VERSION}.dist-info
  COMPONENT python EXCLUDE_FROM_ALL)

install(CODE "set(SOURCES \"${PROJECT_SOURCE_DIR}\")" COMPONENT documentation EXCLUDE_FROM_ALL)
install(SCRIPT ${control}/documents.cmake COMPONENT documentation EXCLUDE_FROM_ALL)

# The change log of the project under Debian's name for it, and the one that Debian asks for beside it.
set(ENV{SOURCE_DATE_EPOCH} ${DRIVEBENCH_DATE})
string(TIMESTAMP date "%a, %d %b %Y %H:%M:%S +0000" UTC)
unset(ENV{SOURCE_DATE_EPOCH})
configure_file(${control}/changelog.Debian.in packages/changelog.Debian @ONLY)
configure_file(${PROJECT_SOURCE_DIR}/CHANGELOG.md packages/changelog COPYONLY)
execute_process(COMMAND gzip -9nkf changelog.Debian changelog WORKING_DIRECTORY ${made} COMMAND_ERROR_IS_FATAL ANY)
foreach(pair server:drivebench-server tools:drivebench data:drivebench-data libraries:${library} development:libdrivebench-dev python:python3-drivebench
    documentation:drivebench-doc)
  string(REPLACE ":" ";" pair ${pair})
  list(GET pair 0 component)
  list(GET pair 1 package)
  install(FILES ${control}/copyright ${made}/changelog.Debian.gz ${made}/changelog.gz
    DESTINATION share/doc/${package} COMPONENT ${component} EXCLUDE_FROM_ALL)
  set(more_overrides "")
  if(component STREQUAL libraries)
    set(more_overrides "# CPack writes both scripts for libraries; they repeat what the trigger does.
${package}: maintscript-calls-ldconfig *")
  endif()
  configure_file(${control}/overrides.in packages/${package} @ONLY)
  install(FILES ${made}/${package} DESTINATION share/lintian/overrides COMPONENT ${component} EXCLUDE_FROM_ALL)
endforeach()
include(CPack)
