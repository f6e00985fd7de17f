// The arm as a SystemInterface of ros2_control: position commands; position, velocity and effort states.
#pragma once

#include <array>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "hardware_interface/system_interface.hpp"
#include "hardware_interface/types/hardware_interface_type_values.hpp"
#include "powerball.h"

namespace powerball
{
class PowerballSystem : public hardware_interface::SystemInterface
{
public:
  using CallbackReturn = hardware_interface::CallbackReturn;
  using return_type = hardware_interface::return_type;

  ~PowerballSystem() override { powerball_close(arm_); }

  // The hardware parameter `bus` names the bus; `mounting` and `values` are those of powerball_guard_model, `accept_unverified` (true) is powerball_accept_unverified. Six joints are expected, from the base on.
  CallbackReturn on_init(const hardware_interface::HardwareInfo & info) override
  {
    if (SystemInterface::on_init(info) != CallbackReturn::SUCCESS) {
      return CallbackReturn::ERROR;
    }
    if (info_.joints.size() != POWERBALL_JOINTS || info_.hardware_parameters.count("bus") == 0) {
      std::fprintf(stderr, "powerball: six joints and the hardware parameter \"bus\" are needed\n");
      return CallbackReturn::ERROR;
    }
    return CallbackReturn::SUCCESS;
  }

  CallbackReturn on_configure(const rclcpp_lifecycle::State &) override
  {
    if (arm_ == nullptr) {
      char why[512] = "";
      arm_ = powerball_open(info_.hardware_parameters["bus"].c_str(), why, sizeof(why));
      if (arm_ == nullptr) {
        std::fprintf(stderr, "powerball: %s\n", why);
        return CallbackReturn::FAILURE;
      }
      // How the base stands and what the arm weighs: no set-point leaves that takes more torque than a joint has.
      if (!check(powerball_guard_model(arm_, parameter("mounting"), parameter("values")))) {
        return CallbackReturn::FAILURE;
      }
      const char * accept = parameter("accept_unverified");
      if (accept != nullptr && std::string(accept) == "true") {
        powerball_accept_unverified(arm_);
      }
    }
    return check(powerball_configure(arm_)) ? CallbackReturn::SUCCESS : CallbackReturn::FAILURE;
  }

  CallbackReturn on_cleanup(const rclcpp_lifecycle::State &) override
  {
    powerball_close(arm_);
    arm_ = nullptr;
    return CallbackReturn::SUCCESS;
  }

  CallbackReturn on_activate(const rclcpp_lifecycle::State &) override
  {
    if (!check(powerball_activate(arm_)) || !check(read_all())) {
      return CallbackReturn::FAILURE;
    }
    // Where the arm is, until a controller says otherwise.
    command_ = position_;
    return CallbackReturn::SUCCESS;
  }

  CallbackReturn on_deactivate(const rclcpp_lifecycle::State &) override
  {
    return check(powerball_deactivate(arm_)) ? CallbackReturn::SUCCESS : CallbackReturn::ERROR;
  }

  // The arm stands, its cause was reported; it is configured and activated again by whoever looks after it.
  CallbackReturn on_error(const rclcpp_lifecycle::State &) override
  {
    const bool stands = powerball_on_error(arm_) != POWERBALL_ERROR;
    powerball_close(arm_);
    arm_ = nullptr;
    return stands ? CallbackReturn::SUCCESS : CallbackReturn::ERROR;
  }

  std::vector<hardware_interface::StateInterface> export_state_interfaces() override
  {
    std::vector<hardware_interface::StateInterface> all;
    for (size_t j = 0; j < POWERBALL_JOINTS; ++j) {
      all.emplace_back(info_.joints[j].name, hardware_interface::HW_IF_POSITION, &position_[j]);
      all.emplace_back(info_.joints[j].name, hardware_interface::HW_IF_VELOCITY, &velocity_[j]);
      all.emplace_back(info_.joints[j].name, hardware_interface::HW_IF_EFFORT, &effort_[j]);
    }
    return all;
  }

  std::vector<hardware_interface::CommandInterface> export_command_interfaces() override
  {
    std::vector<hardware_interface::CommandInterface> all;
    for (size_t j = 0; j < POWERBALL_JOINTS; ++j) {
      all.emplace_back(info_.joints[j].name, hardware_interface::HW_IF_POSITION, &command_[j]);
    }
    return all;
  }

  return_type read(const rclcpp::Time &, const rclcpp::Duration &) override
  {
    return check(read_all()) ? return_type::OK : return_type::ERROR;
  }

  return_type write(const rclcpp::Time &, const rclcpp::Duration &) override
  {
    // A refusal is reported; the driver goes on as it went and stops the arm with the third, which read then
    // reports.
    check(powerball_write(arm_, command_.data()));
    return return_type::OK;
  }

private:
  using Joints = std::array<double, POWERBALL_JOINTS>;

  // A hardware parameter that may be left out.
  const char * parameter(const std::string & name) const
  {
    const auto found = info_.hardware_parameters.find(name);
    return found == info_.hardware_parameters.end() ? nullptr : found->second.c_str();
  }

  int read_all() { return powerball_read(arm_, position_.data(), velocity_.data(), effort_.data()); }

  bool check(int code)
  {
    if (code == POWERBALL_ERROR) {
      std::fprintf(stderr, "powerball: %s\n", powerball_message(arm_));
    }
    return code != POWERBALL_ERROR;
  }

  powerball_arm * arm_ = nullptr;
  Joints position_{}, velocity_{}, effort_{}, command_{};
};
}  // namespace powerball
