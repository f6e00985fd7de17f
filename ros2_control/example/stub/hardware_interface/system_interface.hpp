// As much of ros2_control's hardware_interface as powerball_system.hpp uses, so that it compiles and runs where no ROS is
// installed. In a ROS 2 workspace the real header is found instead.
#pragma once

#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

namespace rclcpp
{
class Time
{
};
class Duration
{
};
}  // namespace rclcpp

namespace rclcpp_lifecycle
{
class State
{
};
namespace node_interfaces
{
struct LifecycleNodeInterface
{
  enum class CallbackReturn { SUCCESS, FAILURE, ERROR };
};
}  // namespace node_interfaces
}  // namespace rclcpp_lifecycle

namespace hardware_interface
{
constexpr char HW_IF_POSITION[] = "position";
constexpr char HW_IF_VELOCITY[] = "velocity";
constexpr char HW_IF_EFFORT[] = "effort";

enum class return_type { OK, ERROR };
using CallbackReturn = rclcpp_lifecycle::node_interfaces::LifecycleNodeInterface::CallbackReturn;

struct ComponentInfo
{
  std::string name;
};

struct HardwareInfo
{
  std::string name;
  std::unordered_map<std::string, std::string> hardware_parameters;
  std::vector<ComponentInfo> joints;
};

class Handle
{
public:
  Handle(std::string joint, std::string interface, double * value)
  : joint_(std::move(joint)), interface_(std::move(interface)), value_(value)
  {
  }
  std::string get_name() const { return joint_ + "/" + interface_; }
  double get_value() const { return *value_; }
  void set_value(double value) { *value_ = value; }

private:
  std::string joint_, interface_;
  double * value_;
};
using StateInterface = Handle;
using CommandInterface = Handle;

class SystemInterface
{
public:
  virtual ~SystemInterface() = default;
  virtual CallbackReturn on_init(const HardwareInfo & info)
  {
    info_ = info;
    return CallbackReturn::SUCCESS;
  }
  virtual CallbackReturn on_configure(const rclcpp_lifecycle::State &) = 0;
  virtual CallbackReturn on_cleanup(const rclcpp_lifecycle::State &) = 0;
  virtual CallbackReturn on_activate(const rclcpp_lifecycle::State &) = 0;
  virtual CallbackReturn on_deactivate(const rclcpp_lifecycle::State &) = 0;
  virtual CallbackReturn on_error(const rclcpp_lifecycle::State &) = 0;
  virtual std::vector<StateInterface> export_state_interfaces() = 0;
  virtual std::vector<CommandInterface> export_command_interfaces() = 0;
  virtual return_type read(const rclcpp::Time &, const rclcpp::Duration &) = 0;
  virtual return_type write(const rclcpp::Time &, const rclcpp::Duration &) = 0;

protected:
  HardwareInfo info_;
};
}  // namespace hardware_interface
