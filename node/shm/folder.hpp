// The daemon's side of tactiled/folder.h: its run-time folder, which has the segment and the control socket.
#pragma once
#include <string>

namespace tactiled {

// Returns the folder that TACTILED_RUNTIME_DIR names; /run/tactiled if the process may write there (root creates it);
// else $XDG_RUNTIME_DIR/tactiled, which is created. setup: throws SetupError where there is none, or readers would
// not trust it
std::string runtime_folder();

// Sets the folder for every later call of runtime_folder() and every reader of this process. Before the first thread.
void set_runtime_folder(const std::string& folder);

// Returns a warning for the log about a folder that works but has a disadvantage; "" if it has none.
std::string folder_warning(const std::string& folder, const std::string& node_name);

// Returns the path of the control socket: `configured`, unless that is the default of another folder than this one.
std::string control_in(const std::string& folder, const std::string& node_name, const std::string& configured);

}  // namespace tactiled
