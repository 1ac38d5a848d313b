# A screen of our own for what draws through X, so that nothing is drawn by whatever serves the user's; sourced from the
# root of the tree. xvfb-run may start the program before its server takes connections, which VTK does not survive; and two
# that start at once may take the same number, so that they begin to look at different ones. A server that resets when its
# last client leaves would be gone for a moment between two meshes.
on_screen() {
    xvfb-run -a -n $((200 + $$ % 1000)) -s '-screen 0 1920x1280x24 -noreset' sh -c '
        for i in 1 2 3 4 5 6 7 8 9 10; do
            sleep 0.5
            [ ! -S "/tmp/.X11-unix/X${DISPLAY#:}" ] || break
        done
        exec "$@"' sh "$@"
}
