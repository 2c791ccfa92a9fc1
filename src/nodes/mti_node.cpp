// Driver of an MTi; or, without a master, what is connected. 0 ok, 1 failed, 2 usage.
#include "scanner/ros/mti_node.h"

#include "nodes/node_main.h"
#include "tools/run.h"

int main(int argc, char** argv) {
  constexpr const char* kName = "mti_node";
  ros::V_string arguments;
  ros::removeROSArgs(argc, argv, arguments);  // remappings and _parameter:=value
  CLI::App app("Publishes the samples of an Xsens MTi (docs/drivers.md).", kName);
  bool list = false;
  std::string port;
  CLI::Option* const list_option = app.add_flag("--list", list, "print the serial ports, and exit");
  const CLI::Option* const probe =
      app.add_option("--probe", port,
                     "ask what is on the serial port PORT (without it: on all, until an MTi "
                     "answers), print it, and exit")
          ->type_name("PORT")
          ->expected(0, 1)
          ->excludes(list_option);
  std::vector<char*> plain;
  for (std::string& argument : arguments) plain.push_back(argument.data());
  return scanner::tools::run(app, static_cast<int>(plain.size()), plain.data(), [&] {
    if (list) {
      const std::string ports = scanner::bridge::listMtiPorts();
      std::fputs(ports.empty() ? "no serial port found\n" : ports.c_str(),
                 ports.empty() ? stderr : stdout);
      return 0;
    }
    if (probe->count() == 0) {
      return scanner::nodes::run<scanner::bridge::MtiNode>(argc, argv, kName);
    }
    const scanner::Result<std::string> text = scanner::bridge::probeMti(port);
    if (!text) throw scanner::ConfigurationError(text.status().message());
    std::fputs(text->c_str(), stdout);
    return 0;
  });
}
