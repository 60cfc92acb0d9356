"""LinuxCNC as a judge: its interpreter and its whole controller, both without display or real time.

The functions for other tests are `comparison.assert_same_moves` and `controller.run_on_controller`.
"""
