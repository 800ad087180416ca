"""Files to pixels: decoded, undistorted, reduced, brought onto one canvas."""
