# Included at the end of project() where ROS comes from pip: always for the wheel (turnmill_msgs_build.py), and for
# colcon over a pip environment by -DCMAKE_PROJECT_INCLUDE=<this file>. A ROS installation does not need it.

if(SKBUILD)
  # Python modules go to site-packages, whatever ament_cmake_python would choose.
  set(PYTHON_INSTALL_DIR "${SKBUILD_PLATLIB_DIR}" CACHE PATH "site-packages of the wheel" FORCE)
  # Libraries lie in <prefix>/lib, extension modules in <prefix>/lib/pythonX.Y/site-packages/turnmill_msgs.
  set(CMAKE_INSTALL_RPATH "$ORIGIN:$ORIGIN/../../..")
  set(BUILD_TESTING OFF CACHE BOOL "" FORCE)
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
