"""What scikit-learn makes of nine points in three groups, for the test of crates/diagnose-benchmark/src/gaussian_process.rs.

    pip install scikit-learn==1.9.1
    python tests/peers/gaussian_process.py

The covariance and the grid are those of that file; each group is left out by fitting without it.
"""

import numpy as np
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel
from sklearn.model_selection import LeaveOneGroupOut, cross_val_predict

i = np.arange(9)
x = np.stack([0.3 * i, (i * i) % 5], axis=1)
y = np.sin(2 * x[:, 0]) + 0.1 * x[:, 1] + 0.5
groups = np.array([0, 0, 0, 1, 1, 2, 2, 2, 2])
new = np.array([[0.4, 2.0], [3.0, 1.0]])
centre, scale = x.mean(axis=0), x.std(axis=0)


def standard(x):
    return (x - centre) / scale


def process(length, noise):
    kernel = ConstantKernel(1.0) + RBF(length * np.sqrt(2)) + WhiteKernel(noise)
    return GaussianProcessRegressor(kernel, optimizer=None, alpha=1e-14)


def left_out(length, noise):
    said = cross_val_predict(process(length, noise), standard(x), y, groups=groups, cv=LeaveOneGroupOut())
    return np.mean((y - said) ** 2), length, noise


tried = sorted(left_out(l, n) for l in (0.25, 0.5, 1, 2, 4) for n in (0.001, 0.01, 0.1, 1, 10, 100, 1000))
squared, length, noise = tried[0]
print("length", length, "noise", noise, "left out", squared, "next", tried[1])
print("means", process(length, noise).fit(standard(x), y).predict(standard(new)))
