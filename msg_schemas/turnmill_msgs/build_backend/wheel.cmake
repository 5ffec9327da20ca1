# Included at the end of project() where ROS comes from pip: always for the wheel (turnmill_msgs_build.py), and for
# colcon over a pip environment by -DCMAKE_PROJECT_INCLUDE=<this file>. A ROS installation does not need it.

if(SKBUILD)
  # Python modules go to site-packages, whatever ament_cmake_python would choose.
  set(PYTHON_INSTALL_DIR "${SKBUILD_PLATLIB_DIR}" CACHE PATH "site-packages of the wheel" FORCE)
  # Libraries lie in <prefix>/lib, extension modules in <prefix>/lib/pythonX.Y/site-packages/turnmill_msgs.
  set(CMAKE_INSTALL_RPATH "$ORIGIN:$ORIGIN/../../..")
  set(BUILD_TESTING OFF CACHE BOOL "" FORCE)
  # rclpy loads the C typesupport only. The C++ libraries would take half of the time; they are compiled from an empty
  # file and left out of the wheel (wheel.exclude in pyproject.toml).
  file(WRITE "${CMAKE_BINARY_DIR}/empty.cpp" "")
  function(_turnmill_skip_cpp_typesupport)
    get_property(targets DIRECTORY "${CMAKE_SOURCE_DIR}" PROPERTY BUILDSYSTEM_TARGETS)
    foreach(target IN LISTS targets)
      if(target MATCHES "__rosidl_typesupport_(cpp|fastrtps_cpp|introspection_cpp)$")
        set_target_properties(${target} PROPERTIES SOURCES "${CMAKE_BINARY_DIR}/empty.cpp")
        string(REPLACE "${PROJECT_NAME}__" "" generator ${target})
        file(MAKE_DIRECTORY "${CMAKE_BINARY_DIR}/${generator}/${PROJECT_NAME}")  # of headers that are not generated
      endif()
    endforeach()
  endfunction()
  cmake_language(DEFER DIRECTORY "${CMAKE_SOURCE_DIR}" CALL _turnmill_skip_cpp_typesupport)
endif()

# The ROS wheels' imported targets name include folders of the machine that built them.
function(_turnmill_drop_missing_include_folders)
  get_property(targets DIRECTORY "${CMAKE_SOURCE_DIR}" PROPERTY IMPORTED_TARGETS)
  foreach(target IN LISTS targets)
    get_target_property(folders ${target} INTERFACE_INCLUDE_DIRECTORIES)
    if(folders)
      set(present "")
      foreach(folder IN LISTS folders)
        if(folder MATCHES "\\$<" OR EXISTS "${folder}")
          list(APPEND present "${folder}")
        endif()
      endforeach()
      set_target_properties(${target} PROPERTIES INTERFACE_INCLUDE_DIRECTORIES "${present}")
    endif()
  endforeach()
endfunction()

cmake_language(DEFER DIRECTORY "${CMAKE_SOURCE_DIR}" CALL _turnmill_drop_missing_include_folders)
