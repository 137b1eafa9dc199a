// Axes of a Catenary share for a hardware component of ros2_control. This part does not use ROS.
#ifndef CATENARY_ROS2_CONTROL_ARM_SHARE_HPP
#define CATENARY_ROS2_CONTROL_ARM_SHARE_HPP

#include <cstdint>
#include <string>
#include <vector>

#include "catenary_share.h"

namespace catenary_ros2_control {

enum class Quantity { position, velocity, effort };

// Return the quantity of a command interface: "position", "velocity" or "effort".
// Throws std::invalid_argument for another name.
Quantity quantity_of(const std::string &interface);

// Owner of an open share and, while it is active, of a lease on some of its axes.
//
// `position` [rad], `velocity` [rad/s] and `effort` [N·m] are the values of the newest cycle, one for
// each axis. `command` has the set-points, in the unit of the quantity. NaN: no set-point.
// read() and write() do not allocate memory.
class ArmShare {
public:
    // `axes`: names of axes of the share. `lease`: time until the axes are released after the last
    // write() [s].
    ArmShare(std::string share, std::vector<std::string> axes, Quantity quantity, double lease);
    ~ArmShare();
    ArmShare(const ArmShare &) = delete;
    ArmShare &operator=(const ArmShare &) = delete;

    // Open the share. Throws std::runtime_error if it is missing, its loop does not run, or it does not
    // have the axes.
    void open();
    void close();

    // Take the lease. Throws std::runtime_error, for example if another client has an axis.
    void activate();
    // Release the lease. The axes hold their commanded position, and torques become 0.
    void deactivate();

    // Copy the newest cycle. Return false if the loop has ended or died; error() has the reason.
    bool read();
    // Send the set-points and renew the lease. If one of them is NaN, only renew the lease. Return false
    // if the lease has ended or the loop does not read commands; error() has the reason.
    bool write();

    bool is_active() const { return lease_ != nullptr; }
    std::uint64_t cycle() const { return number_; }
    const char *error() const { return error_.text; }

    std::vector<double> position, velocity, effort, command;

private:
    void find_axes();
    const catenary_field *field(const char *name) const;

    std::string share_name_;
    std::vector<std::string> names_;
    Quantity quantity_;
    double duration_;
    catenary_share *share_ = nullptr;
    catenary_lease *lease_ = nullptr;
    catenary_error error_ = {};
    std::vector<std::uint32_t> axes_;
    std::vector<char> row_;
    std::uint64_t number_ = 0;
    const catenary_field *position_ = nullptr, *velocity_ = nullptr, *effort_ = nullptr;
};

}  // namespace catenary_ros2_control

#endif
