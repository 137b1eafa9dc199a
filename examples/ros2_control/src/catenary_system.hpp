// Hardware component of ros2_control for the axes of a Catenary share.
#ifndef CATENARY_ROS2_CONTROL_CATENARY_SYSTEM_HPP
#define CATENARY_ROS2_CONTROL_CATENARY_SYSTEM_HPP

#include <memory>
#include <vector>

#include "arm_share.hpp"
#include "hardware_interface/handle.hpp"
#include "hardware_interface/hardware_info.hpp"
#include "hardware_interface/system_interface.hpp"
#include "hardware_interface/types/hardware_interface_return_values.hpp"
#include "rclcpp/duration.hpp"
#include "rclcpp/time.hpp"
#include "rclcpp_lifecycle/state.hpp"

namespace catenary_ros2_control {

// Parameters of <hardware>: `share` (its name), `lease` [s] (default 0.1). Parameter of each <joint>:
// `axis`, the name of its axis in the share; by default, the name of the joint. All joints have one
// command interface of the same kind, and the state interfaces position, velocity and effort.
class CatenarySystem : public hardware_interface::SystemInterface {
public:
    using CallbackReturn = hardware_interface::CallbackReturn;

    CallbackReturn on_init(const hardware_interface::HardwareInfo &info) override;
    CallbackReturn on_configure(const rclcpp_lifecycle::State &previous) override;
    CallbackReturn on_cleanup(const rclcpp_lifecycle::State &previous) override;
    CallbackReturn on_activate(const rclcpp_lifecycle::State &previous) override;
    CallbackReturn on_deactivate(const rclcpp_lifecycle::State &previous) override;
    CallbackReturn on_error(const rclcpp_lifecycle::State &previous) override;

    std::vector<hardware_interface::StateInterface> export_state_interfaces() override;
    std::vector<hardware_interface::CommandInterface> export_command_interfaces() override;

    hardware_interface::return_type read(const rclcpp::Time &time, const rclcpp::Duration &period) override;
    hardware_interface::return_type write(const rclcpp::Time &time, const rclcpp::Duration &period) override;

private:
    std::unique_ptr<ArmShare> arm_;
};

}  // namespace catenary_ros2_control

#endif
