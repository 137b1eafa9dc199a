// NOT COMPILED in the tests of Catenary, because the headers of ROS 2 are not available there. All
// code that does not use ROS is in arm_share.cpp, which is tested.
#include "catenary_system.hpp"

#include <exception>
#include <stdexcept>
#include <string>

#include "pluginlib/class_list_macros.hpp"
#include "rclcpp/logging.hpp"

namespace catenary_ros2_control {

namespace {

const char *const kStates[] = {"position", "velocity", "effort"};

rclcpp::Logger logger() {
    return rclcpp::get_logger("CatenarySystem");
}

// Run a step of the life cycle, and report its exception.
template <typename Step>
hardware_interface::CallbackReturn reported(Step step) {
    try {
        step();
        return hardware_interface::CallbackReturn::SUCCESS;
    } catch (const std::exception &error) {
        RCLCPP_ERROR(logger(), "%s", error.what());
        return hardware_interface::CallbackReturn::ERROR;
    }
}

std::unique_ptr<ArmShare> make_arm(const hardware_interface::HardwareInfo &info) {
    std::vector<std::string> axes;
    std::string interface;
    for (const auto &joint : info.joints) {
        const auto axis = joint.parameters.find("axis");
        axes.push_back(axis == joint.parameters.end() ? joint.name : axis->second);
        if (joint.command_interfaces.size() != 1) {
            throw std::invalid_argument("joint '" + joint.name + "' must have one command interface");
        }
        const auto &name = joint.command_interfaces[0].name;
        if (!interface.empty() && name != interface) {
            throw std::invalid_argument("all joints must have the same kind of command interface");
        }
        interface = name;
    }
    if (axes.empty()) throw std::invalid_argument("the URDF has no joint for this hardware");
    const auto share = info.hardware_parameters.find("share");
    if (share == info.hardware_parameters.end()) throw std::invalid_argument("<hardware> needs the parameter 'share'");
    const auto lease = info.hardware_parameters.find("lease");
    const double duration = lease == info.hardware_parameters.end() ? 0.1 : std::stod(lease->second);
    return std::make_unique<ArmShare>(share->second, axes, quantity_of(interface), duration);
}

}  // namespace

CatenarySystem::CallbackReturn CatenarySystem::on_init(const hardware_interface::HardwareInfo &info) {
    if (hardware_interface::SystemInterface::on_init(info) != CallbackReturn::SUCCESS) {
        return CallbackReturn::ERROR;
    }
    return reported([this] { arm_ = make_arm(info_); });
}

CatenarySystem::CallbackReturn CatenarySystem::on_configure(const rclcpp_lifecycle::State &) {
    return reported([this] { arm_->open(); });
}

CatenarySystem::CallbackReturn CatenarySystem::on_cleanup(const rclcpp_lifecycle::State &) {
    return reported([this] { arm_->close(); });
}

CatenarySystem::CallbackReturn CatenarySystem::on_activate(const rclcpp_lifecycle::State &) {
    return reported([this] { arm_->activate(); });
}

CatenarySystem::CallbackReturn CatenarySystem::on_deactivate(const rclcpp_lifecycle::State &) {
    return reported([this] { arm_->deactivate(); });
}

CatenarySystem::CallbackReturn CatenarySystem::on_error(const rclcpp_lifecycle::State &) {
    return reported([this] { arm_->close(); });
}

std::vector<hardware_interface::StateInterface> CatenarySystem::export_state_interfaces() {
    std::vector<hardware_interface::StateInterface> interfaces;
    for (std::size_t k = 0; k < info_.joints.size(); k++) {
        double *const values[] = {&arm_->position[k], &arm_->velocity[k], &arm_->effort[k]};
        for (std::size_t m = 0; m < 3; m++) {
            interfaces.emplace_back(info_.joints[k].name, kStates[m], values[m]);
        }
    }
    return interfaces;
}

std::vector<hardware_interface::CommandInterface> CatenarySystem::export_command_interfaces() {
    std::vector<hardware_interface::CommandInterface> interfaces;
    for (std::size_t k = 0; k < info_.joints.size(); k++) {
        const auto &joint = info_.joints[k];
        interfaces.emplace_back(joint.name, joint.command_interfaces[0].name, &arm_->command[k]);
    }
    return interfaces;
}

hardware_interface::return_type CatenarySystem::read(const rclcpp::Time &, const rclcpp::Duration &) {
    if (arm_->read()) return hardware_interface::return_type::OK;
    RCLCPP_ERROR(logger(), "cannot read: %s", arm_->error());
    return hardware_interface::return_type::ERROR;
}

hardware_interface::return_type CatenarySystem::write(const rclcpp::Time &, const rclcpp::Duration &) {
    if (!arm_->is_active() || arm_->write()) return hardware_interface::return_type::OK;
    RCLCPP_ERROR(logger(), "cannot write: %s", arm_->error());
    return hardware_interface::return_type::ERROR;
}

}  // namespace catenary_ros2_control

PLUGINLIB_EXPORT_CLASS(catenary_ros2_control::CatenarySystem, hardware_interface::SystemInterface)
