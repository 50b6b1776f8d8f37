import numpy as np

from ddf.metrics import camera_errors


def test_azimuth_differences_wrap_round():
    first, second = (np.radians(angles) for angles in ([350.0, 10.0, 0.0, 725.0], [10.0, 350.0, 180.0, 5.0]))
    np.testing.assert_allclose(camera_errors.angle_difference_deg(first, second), [20, 20, 180, 0], atol=1e-10)


def test_errors_by_hand():
    guess, truth = np.array([[np.radians(359.0), np.radians(20.0), 1.5]]), np.array([[np.radians(1.0), 0.0, 1.25]])
    found = {name: error.compute(guess, truth, np.array([0.9]))[0] for name, error in camera_errors.ERRORS.items()}
    np.testing.assert_allclose(list(found.values()), [2.0, 20.0, 0.25, 10.0])
