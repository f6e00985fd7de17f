// As much of ros2_control's handles as the examples use.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>

namespace hardware_interface
{
class Handle
{
public:
  using SharedPtr = std::shared_ptr<Handle>;

  Handle(std::string prefix, std::string interface, double * value)
  : prefix_(std::move(prefix)), interface_(std::move(interface)), value_(value)
  {
  }
  std::string get_name() const { return prefix_ + "/" + interface_; }
  const std::string & get_prefix_name() const { return prefix_; }
  const std::string & get_interface_name() const { return interface_; }
  double get_value() const { return *value_; }
  std::optional<double> get_optional() const { return *value_; }
  bool set_value(double value)
  {
    *value_ = value;
    return true;
  }

private:
  std::string prefix_, interface_;
  double * value_;
};
using StateInterface = Handle;
using CommandInterface = Handle;

// What a controller is lent of the hardware's.
class LoanedStateInterface
{
public:
  explicit LoanedStateInterface(StateInterface::SharedPtr handle) : handle_(std::move(handle)) {}
  std::string get_name() const { return handle_->get_name(); }
  std::optional<double> get_optional() const { return handle_->get_optional(); }

private:
  StateInterface::SharedPtr handle_;
};

class LoanedCommandInterface
{
public:
  explicit LoanedCommandInterface(CommandInterface::SharedPtr handle) : handle_(std::move(handle)) {}
  std::string get_name() const { return handle_->get_name(); }
  [[nodiscard]] bool set_value(double value) { return handle_->set_value(value); }

private:
  CommandInterface::SharedPtr handle_;
};
}  // namespace hardware_interface
