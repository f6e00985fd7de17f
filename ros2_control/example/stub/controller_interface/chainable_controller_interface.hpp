// As much of ros2_control's controller_interface (Jazzy) as torque_controller.hpp uses, so that it compiles and runs where no
// ROS is installed. In a ROS 2 workspace the real header is found instead.
#pragma once

#include "hardware_interface/handle.hpp"
#include "rclcpp/rclcpp.hpp"

#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace controller_interface
{
using CallbackReturn = rclcpp_lifecycle::node_interfaces::LifecycleNodeInterface::CallbackReturn;

enum class return_type : std::uint8_t { OK = 0, ERROR = 1 };

enum class interface_configuration_type : std::uint8_t { ALL = 0, INDIVIDUAL = 1, NONE = 2 };

struct InterfaceConfiguration
{
  interface_configuration_type type;
  std::vector<std::string> names = {};
};

class ControllerInterfaceBase
{
public:
  virtual ~ControllerInterfaceBase() = default;

  virtual return_type init(
    const std::string & controller_name, const std::string & /*urdf*/, unsigned int cm_update_rate,
    const std::string & /*node_namespace*/, const rclcpp::NodeOptions & /*node_options*/)
  {
    node_ = std::make_shared<rclcpp_lifecycle::LifecycleNode>(controller_name);
    update_rate_ = cm_update_rate;
    return on_init() == CallbackReturn::SUCCESS ? return_type::OK : return_type::ERROR;
  }

  virtual CallbackReturn on_init() = 0;
  virtual CallbackReturn on_configure(const rclcpp_lifecycle::State &) { return CallbackReturn::SUCCESS; }
  virtual CallbackReturn on_activate(const rclcpp_lifecycle::State &) { return CallbackReturn::SUCCESS; }
  virtual CallbackReturn on_deactivate(const rclcpp_lifecycle::State &) { return CallbackReturn::SUCCESS; }
  virtual InterfaceConfiguration command_interface_configuration() const = 0;
  virtual InterfaceConfiguration state_interface_configuration() const = 0;
  virtual return_type update(const rclcpp::Time & time, const rclcpp::Duration & period) = 0;

  void assign_interfaces(
    std::vector<hardware_interface::LoanedCommandInterface> && command_interfaces,
    std::vector<hardware_interface::LoanedStateInterface> && state_interfaces)
  {
    command_interfaces_ = std::move(command_interfaces);
    state_interfaces_ = std::move(state_interfaces);
  }
  void release_interfaces()
  {
    command_interfaces_.clear();
    state_interfaces_.clear();
  }

  std::shared_ptr<rclcpp_lifecycle::LifecycleNode> get_node() const { return node_; }
  unsigned int get_update_rate() const { return update_rate_; }

  template <typename ParameterT>
  ParameterT auto_declare(const std::string & name, const ParameterT & default_value)
  {
    return node_->declare_parameter<ParameterT>(name, default_value);
  }

protected:
  std::vector<hardware_interface::LoanedCommandInterface> command_interfaces_;
  std::vector<hardware_interface::LoanedStateInterface> state_interfaces_;

private:
  std::shared_ptr<rclcpp_lifecycle::LifecycleNode> node_;
  unsigned int update_rate_ = 0;
};

class ChainableControllerInterface : public ControllerInterfaceBase
{
public:
  return_type update(const rclcpp::Time & time, const rclcpp::Duration & period) final
  {
    if (!is_in_chained_mode()) {
      const return_type done = update_reference_from_subscribers(time, period);
      if (done != return_type::OK) {
        return done;
      }
    }
    return update_and_write_commands(time, period);
  }

  std::vector<hardware_interface::StateInterface::SharedPtr> export_state_interfaces()
  {
    return exported(on_export_state_interfaces());
  }
  std::vector<hardware_interface::CommandInterface::SharedPtr> export_reference_interfaces()
  {
    return exported(on_export_reference_interfaces());
  }
  bool set_chained_mode(bool chained_mode)
  {
    in_chained_mode_ = on_set_chained_mode(chained_mode) && chained_mode;
    return true;
  }
  bool is_in_chained_mode() const { return in_chained_mode_; }

protected:
  virtual std::vector<hardware_interface::StateInterface> on_export_state_interfaces() { return {}; }
  virtual std::vector<hardware_interface::CommandInterface> on_export_reference_interfaces() { return {}; }
  virtual bool on_set_chained_mode(bool /*chained_mode*/) { return true; }
  virtual return_type update_reference_from_subscribers(
    const rclcpp::Time & time, const rclcpp::Duration & period) = 0;
  virtual return_type update_and_write_commands(
    const rclcpp::Time & time, const rclcpp::Duration & period) = 0;

  std::vector<double> state_interfaces_values_;
  std::vector<double> reference_interfaces_;

private:
  // Names begin with the controller's, as the controller manager asks for.
  std::vector<hardware_interface::Handle::SharedPtr> exported(const std::vector<hardware_interface::Handle> & all) const
  {
    std::vector<hardware_interface::Handle::SharedPtr> shared;
    for (const auto & handle : all) {
      if (handle.get_prefix_name() != get_node()->get_name()) {
        throw std::runtime_error("an exported interface does not begin with the controller's name");
      }
      shared.push_back(std::make_shared<hardware_interface::Handle>(handle));
    }
    return shared;
  }

  bool in_chained_mode_ = false;
};
}  // namespace controller_interface
