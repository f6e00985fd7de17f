// As much of rclcpp and rclcpp_lifecycle as the examples use, so that they compile and run where no ROS is installed.
#pragma once

#include <map>
#include <stdexcept>
#include <string>
#include <utility>
#include <variant>
#include <vector>

namespace rclcpp
{
class Time
{
};

class Duration
{
public:
  Duration() = default;
  static Duration from_seconds(double seconds)
  {
    Duration all;
    all.seconds_ = seconds;
    return all;
  }
  double seconds() const { return seconds_; }

private:
  double seconds_ = 0.0;
};

class NodeOptions
{
};

using ParameterValue = std::variant<std::string, double, std::vector<std::string>, std::vector<double>>;

// As rclcpp's: a value of another type is an exception.
class Parameter
{
public:
  Parameter(std::string name, ParameterValue value) : name_(std::move(name)), value_(std::move(value)) {}
  const std::string & get_name() const { return name_; }
  const ParameterValue & get_parameter_value() const { return value_; }
  std::string as_string() const { return std::get<std::string>(value_); }
  double as_double() const { return std::get<double>(value_); }
  std::vector<std::string> as_string_array() const { return std::get<std::vector<std::string>>(value_); }
  std::vector<double> as_double_array() const { return std::get<std::vector<double>>(value_); }

private:
  std::string name_;
  ParameterValue value_;
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

class LifecycleNode
{
public:
  explicit LifecycleNode(std::string name) : name_(std::move(name)) {}
  const char * get_name() const { return name_.c_str(); }
  bool has_parameter(const std::string & name) const { return values_.count(name) > 0; }
  template <typename T>
  T declare_parameter(const std::string & name, const T & value)
  {
    values_.insert_or_assign(name, rclcpp::ParameterValue(value));
    return value;
  }
  void set_parameter(const rclcpp::Parameter & parameter)
  {
    values_.insert_or_assign(parameter.get_name(), parameter.get_parameter_value());
  }
  rclcpp::Parameter get_parameter(const std::string & name) const
  {
    const auto found = values_.find(name);
    if (found == values_.end()) {
      throw std::runtime_error("the parameter '" + name + "' was not declared");
    }
    return {name, found->second};
  }

private:
  std::string name_;
  std::map<std::string, rclcpp::ParameterValue> values_;
};
}  // namespace rclcpp_lifecycle
