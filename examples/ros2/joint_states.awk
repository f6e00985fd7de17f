# Lines of `ros2 topic echo --csv /joint_states` as a log with a header line: t, position.NAME, effort.NAME.
# A message is: seconds, nanoseconds, frame, then the names, positions, velocities and efforts of n joints.
BEGIN { FS = "," }
NR == 1 {
    n = int((NF - 3) / 4)
    header = "t"
    for (k = 1; k <= n; k++) header = header ",position." $(3 + k)
    for (k = 1; k <= n; k++) header = header ",effort." $(3 + k)
    print header
}
{
    row = sprintf("%d.%09d", $1, $2)
    for (k = 1; k <= n; k++) row = row "," $(3 + n + k)
    for (k = 1; k <= n; k++) row = row "," $(3 + 3 * n + k)
    print row
    fflush()
}
