// A controller of ros2_control for any arm whose model `powerball generate --c-header` has written: gravity compensation or
// computed torque on effort command interfaces, external torques by joint as states that other controllers can read.
// docs/ros2_control.md has its parameters; no part of it was run on hardware.
#pragma once

#include "powerball_control.h"

#include "controller_interface/chainable_controller_interface.hpp"
#include "hardware_interface/types/hardware_interface_type_values.hpp"

#include <cstdio>
#include <exception>
#include <limits>
#include <string>
#include <vector>

namespace powerball
{
// A plugin derives from it and gives it the arm's functions, as my_arm_controller.hpp does. It is chainable: a
// joint_trajectory_controller before it writes the reference; alone it holds the arm where it was activated.
class TorqueController : public controller_interface::ChainableControllerInterface
{
public:
  using CallbackReturn = controller_interface::CallbackReturn;
  using return_type = controller_interface::return_type;

  explicit TorqueController(const powerball_arm_model & model) : model_(model) {}
  TorqueController(const TorqueController &) = delete;
  TorqueController & operator=(const TorqueController &) = delete;
  ~TorqueController() override { powerball_control_close(control_); }

  CallbackReturn on_init() override
  {
    try {
      auto_declare<std::vector<std::string>>("joints", {});
      auto_declare<std::string>("law", "gravity");
      auto_declare<double>("bandwidth", 0.0);
      auto_declare<double>("damping", 1.0);
      auto_declare<double>("observer_bandwidth", 30.0);
      auto_declare<std::vector<double>>("effort_limits", {});
      auto_declare<std::vector<double>>("effort_rate_limits", {});
    } catch (const std::exception & error) {
      return refuse(CallbackReturn::ERROR, error.what());
    }
    return CallbackReturn::SUCCESS;
  }

  CallbackReturn on_configure(const rclcpp_lifecycle::State &) override
  {
    try {
      return configure();
    } catch (const std::exception & error) {
      return refuse(CallbackReturn::FAILURE, error.what());
    }
  }

  controller_interface::InterfaceConfiguration command_interface_configuration() const override
  {
    return {controller_interface::interface_configuration_type::INDIVIDUAL, names({hardware_interface::HW_IF_EFFORT})};
  }

  controller_interface::InterfaceConfiguration state_interface_configuration() const override
  {
    return {
      controller_interface::interface_configuration_type::INDIVIDUAL,
      names({hardware_interface::HW_IF_POSITION, hardware_interface::HW_IF_VELOCITY})};
  }

  CallbackReturn on_activate(const rclcpp_lifecycle::State &) override
  {
    if (!are(command_interfaces_, command_interface_configuration().names)) {
      return refuse(CallbackReturn::ERROR, "one effort command interface a joint is needed, in the order of the joints");
    }
    if (!are(state_interfaces_, state_interface_configuration().names)) {
      return refuse(CallbackReturn::ERROR, "position and velocity of each joint are needed, in the order of the joints");
    }
    read();
    if (powerball_control_start(control_, position_.data()) != POWERBALL_OK) {
      return refuse(CallbackReturn::ERROR, "a position is no number");
    }
    // At rest where the arm is, until somebody writes another reference.
    reference_interfaces_.assign(3 * joints_.size(), 0.0);
    for (size_t j = 0; j < joints_.size(); ++j) {
      reference_interfaces_[j] = position_[j];
      state_interfaces_values_[j] = 0.0;
    }
    return CallbackReturn::SUCCESS;
  }

  // No torque: brakes, or a hardware that holds the arm by itself, must have it before.
  CallbackReturn on_deactivate(const rclcpp_lifecycle::State &) override
  {
    effort_.assign(joints_.size(), 0.0);
    return write() ? CallbackReturn::SUCCESS : CallbackReturn::ERROR;
  }

protected:
  // NAME/joint1/position to NAME/jointN/acceleration: what computed torque follows.
  std::vector<hardware_interface::CommandInterface> on_export_reference_interfaces() override
  {
    reference_interfaces_.assign(3 * joints_.size(), std::numeric_limits<double>::quiet_NaN());
    std::vector<hardware_interface::CommandInterface> all;
    for (const char * kind : {hardware_interface::HW_IF_POSITION, hardware_interface::HW_IF_VELOCITY,
                              hardware_interface::HW_IF_ACCELERATION}) {
      for (const auto & joint : joints_) {
        all.emplace_back(get_node()->get_name(), joint + "/" + kind, &reference_interfaces_[all.size()]);
      }
    }
    return all;
  }

  // NAME/joint1/external_effort and so on, N m.
  std::vector<hardware_interface::StateInterface> on_export_state_interfaces() override
  {
    state_interfaces_values_.assign(joints_.size(), std::numeric_limits<double>::quiet_NaN());
    std::vector<hardware_interface::StateInterface> all;
    for (size_t j = 0; j < joints_.size(); ++j) {
      all.emplace_back(get_node()->get_name(), joints_[j] + "/external_effort", &state_interfaces_values_[j]);
    }
    return all;
  }

  return_type update_reference_from_subscribers(const rclcpp::Time &, const rclcpp::Duration &) override
  {
    return return_type::OK;
  }

  // Neither allocates nor throws. Where a state is no number the last efforts stay, and the controller manager deactivates.
  return_type update_and_write_commands(const rclcpp::Time &, const rclcpp::Duration & period) override
  {
    read();
    const double * reference = reference_interfaces_.data();
    const size_t n = joints_.size();
    const int done = powerball_control_update(
      control_, position_.data(), velocity_.data(), reference, reference + n, reference + 2 * n, period.seconds(),
      effort_.data(), state_interfaces_values_.data());
    return done == POWERBALL_OK && write() ? return_type::OK : return_type::ERROR;
  }

private:
  CallbackReturn configure()
  {
    const auto node = get_node();
    joints_ = node->get_parameter("joints").as_string_array();
    const std::string law = node->get_parameter("law").as_string();
    const auto limits = node->get_parameter("effort_limits").as_double_array();
    const auto rates = node->get_parameter("effort_rate_limits").as_double_array();
    const size_t n = model_.joints;
    if (joints_.size() != n || limits.size() != n || rates.size() != n) {
      return refuse(CallbackReturn::FAILURE, "joints, effort_limits and effort_rate_limits need one entry a joint of the model");
    }
    if (law != "gravity" && law != "computed_torque") {
      return refuse(CallbackReturn::FAILURE, "law is gravity or computed_torque");
    }
    if (get_update_rate() == 0) {
      return refuse(CallbackReturn::FAILURE, "update_rate is not known");
    }
    powerball_control_options options{};
    options.law = law == "gravity" ? POWERBALL_GRAVITY : POWERBALL_COMPUTED_TORQUE;
    options.period = 1.0 / get_update_rate();
    options.bandwidth = node->get_parameter("bandwidth").as_double();
    options.damping = node->get_parameter("damping").as_double();
    options.observer_bandwidth = node->get_parameter("observer_bandwidth").as_double();
    options.effort_limits = limits.data();
    options.effort_rate_limits = rates.data();
    powerball_control_close(control_);
    char why[512] = "";
    control_ = powerball_control_open(&model_, &options, why, sizeof(why));
    if (control_ == nullptr) {
      return refuse(CallbackReturn::FAILURE, why);
    }
    position_.assign(n, 0.0);
    velocity_.assign(n, 0.0);
    effort_.assign(n, 0.0);
    return CallbackReturn::SUCCESS;
  }

  // JOINT/KIND for each joint, its kinds together.
  std::vector<std::string> names(const std::vector<std::string> & kinds) const
  {
    std::vector<std::string> all;
    for (const auto & joint : joints_) {
      for (const auto & kind : kinds) {
        all.push_back(joint + "/" + kind);
      }
    }
    return all;
  }

  template <typename Interface>
  static bool are(const std::vector<Interface> & interfaces, const std::vector<std::string> & names)
  {
    bool same = interfaces.size() == names.size();
    for (size_t i = 0; same && i < names.size(); ++i) {
      same = interfaces[i].get_name() == names[i];
    }
    return same;
  }

  void read()
  {
    const double none = std::numeric_limits<double>::quiet_NaN();
    for (size_t j = 0; j < joints_.size(); ++j) {
      position_[j] = state_interfaces_[2 * j].get_optional().value_or(none);
      velocity_[j] = state_interfaces_[2 * j + 1].get_optional().value_or(none);
    }
  }

  bool write()
  {
    bool written = command_interfaces_.size() == effort_.size();
    for (size_t j = 0; written && j < effort_.size(); ++j) {
      written = command_interfaces_[j].set_value(effort_[j]);
    }
    return written;
  }

  static CallbackReturn refuse(CallbackReturn code, const char * why)
  {
    std::fprintf(stderr, "powerball: %s\n", why);
    return code;
  }

  powerball_arm_model model_;
  powerball_control * control_ = nullptr;
  std::vector<std::string> joints_;
  std::vector<double> position_, velocity_, effort_;
};
}  // namespace powerball
