// Driver of a Bumblebee; or, without a master, what is connected. 0 ok, 1 failed, 2 usage.
#include "scanner/ros/bumblebee_node.h"

#include "nodes/node_main.h"
#include "tools/run.h"

int main(int argc, char** argv) {
  constexpr const char* kName = "bumblebee_node";
  ros::V_string arguments;
  ros::removeROSArgs(argc, argv, arguments);  // remappings and _parameter:=value
  CLI::App app("Publishes the images of a Bumblebee stereo camera (docs/drivers.md).", kName);
  bool list = false;
  std::string address;
  CLI::Option* const list_option =
      app.add_flag("--list", list, "print the cameras of all buses, and exit");
  const CLI::Option* const probe =
      app.add_option("--probe", address,
                     "open the camera ADDRESS (as --list prints it, serial number, or a folder of "
                     "pictures; without it the first one), print what it is and can do, and exit")
          ->type_name("ADDRESS")
          ->expected(0, 1)
          ->excludes(list_option);
  std::vector<char*> plain;
  for (std::string& argument : arguments) plain.push_back(argument.data());
  return scanner::tools::run(app, static_cast<int>(plain.size()), plain.data(), [&] {
    if (list) {
      const std::string cameras = scanner::bridge::listBumblebees();
      std::fputs(cameras.empty() ? "no camera found\n" : cameras.c_str(),
                 cameras.empty() ? stderr : stdout);
      return 0;
    }
    if (probe->count() == 0) {
      return scanner::nodes::run<scanner::bridge::BumblebeeNode>(argc, argv, kName);
    }
    const scanner::Result<std::string> text = scanner::bridge::probeBumblebee(address);
    if (!text) throw scanner::ConfigurationError(text.status().message());
    std::fputs(text->c_str(), stdout);
    return 0;
  });
}
